"""oatkit in napari: the only part of the package that imports napari, Qt or magicgui.

`document`, `job` and `session` hold the state and know nothing of windows; what is shown is in the others.
"""
