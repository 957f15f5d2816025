"""A pipeline as a Python script that gives the same numbers without a window."""

from pathlib import Path

from oatkit.gui.document import PipelineDocument

SCRIPT = '''"""Run this pipeline on a frame of a scan, and write the images, with how they came about, to a folder.

python SCRIPT.py [SCAN [OUT.zarr [FRAME]]]
"""

import sys
from pathlib import Path

import oatkit

PIPELINE = """{text}"""
DEFAULTS = ({scan}, "result.zarr", "{frame}")


def main() -> None:
    scan_path, output, frame = (*sys.argv[1:], *DEFAULTS[len(sys.argv) - 1 :])
    if not scan_path:
        raise SystemExit("say which scan: python SCRIPT.py SCAN")
    pipeline = oatkit.Pipeline.loads(PIPELINE, folder=Path({folder}))
    result = oatkit.run(pipeline, oatkit.read(scan_path), frame=int(frame))
    result.save(output)
    print(f"wrote {{', '.join(result)}} to {{output}}")


if __name__ == "__main__":
    main()
'''


def script_of(document: PipelineDocument, scan_path: str | Path = "", frame: int = 0) -> str:
    """Return a script that runs the pipeline on a frame of the scan in `scan_path`, or on the one that it is told.

    It gives the numbers of `oatkit.run`. Paths in the pipeline stay relative to the folder of its file.
    """
    text = document.text.replace("\\", "\\\\").replace('"""', '\\"\\"\\"')
    # A text that ends in a quote would end the string.
    text = text if text.endswith("\n") else f"{text}\n"
    scan = str(Path(scan_path).absolute()) if scan_path else ""
    return SCRIPT.format(text=text, scan=repr(scan), frame=frame, folder=repr(str(document.folder.absolute())))
