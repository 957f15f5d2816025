"""The experiments of Prakash et al., IEEE Trans. Biomed. Eng. (2019), repeated with this package.

Each is a function from a `Setting` to a generator of lines on its progress, the last item of which is an `Outcome`: a
figure like the paper's, and a table of the paper's figures beside ours with the reason why they differ.
"""
