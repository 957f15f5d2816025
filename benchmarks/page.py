"""Runs every command of a page of benchmarks and writes what it prints into the page: the whole table in one run.

    python benchmarks/page.py --scan Scan_9.msot --patato .venv-patato [PART ...]

A block of shell commands is followed by the block of its output. PART names commands by a part of their text; without
one, all run, which takes long and wants a machine that does nothing else.
"""

import argparse
import datetime
import re
import subprocess
import sys
from pathlib import Path

from reconstruction import machine

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "speed.md"
PAIR = re.compile(
    r"(```sh\n(?P<command>[^`]*benchmarks/[^`]*)```\n(?:(?!```).)*?```(?:text)?\n)(?P<output>.*?)(```)", re.DOTALL
)
MACHINE = re.compile(r"Figures of one machine .*?, as the commands", re.DOTALL)


def main() -> None:
    """Run what is asked for and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", metavar="PART")
    parser.add_argument("--scan", default="Scan_9.msot")
    parser.add_argument("--patato", default=".venv-patato", metavar="VENV")
    options = parser.parse_args()

    def renewed(pair: re.Match[str]) -> str:
        command = pair["command"].strip()
        if options.parts and not any(part in command for part in options.parts):
            return pair[0]
        print(f"$ {command}", flush=True)
        output = ran(command, options.scan, options.patato)
        print(output, flush=True)
        return pair[1] + output.strip("\n") + "\n" + pair[4]

    text = PAIR.sub(renewed, PAGE.read_text())
    if not options.parts:
        today = datetime.date.today().isoformat()
        text = MACHINE.sub(f"Figures of one machine on one day ({today}: {machine()}), as the commands", text)
    PAGE.write_text(text)


def ran(command: str, scan: str, venv: str) -> str:
    """Return what a command prints. Exits with its complaint where it fails."""
    for shown, used in (
        ("Scan_9.msot", scan),
        (".venv-patato", venv),
        ("python benchmarks", f"{sys.executable} benchmarks"),
    ):
        command = command.replace(shown, used)
    done = subprocess.run(command, shell=True, cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{command} failed:\n{done.stderr[-2000:]}")
    return done.stdout


if __name__ == "__main__":
    main()
