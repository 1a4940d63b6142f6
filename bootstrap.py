"""The two set-up commands; they need Python 3.11 or newer and nothing else.

    python3 bootstrap.py run              install into .venv, run the baseline sail, draw its figures
    python3 bootstrap.py test [OPTION ..] install into .venv with the test tools, run the tests

Options after `test` go to pytest: `python3 bootstrap.py test -m ""` runs the nightly tests too.
"""

import os
import subprocess
import sys

if sys.version_info < (3, 11):  # noqa: UP036  (the reader's Python may be older: say so in words)
    sys.exit(
        "esail_jax needs Python 3.11 or newer, but this is Python %d.%d: "  # noqa: UP031
        "call bootstrap.py with another one, such as python3.11" % sys.version_info[:2]
    )

ROOT = os.path.dirname(os.path.abspath(__file__))
ENVIRONMENT = os.path.join(ROOT, ".venv")
PROGRAMS = os.path.join(ENVIRONMENT, "Scripts" if os.name == "nt" else "bin")
PYTHON = os.path.join(PROGRAMS, "python.exe" if os.name == "nt" else "python")


def call(*command: str) -> None:
    """Run a program in the repository; end with its exit status if that is not 0.

    Ctrl-C reaches the program as well: wait for it to put its files in order.
    """
    with subprocess.Popen(command, cwd=ROOT) as process:
        while True:
            try:
                status = process.wait()
                break
            except KeyboardInterrupt:
                continue
    if status:
        sys.exit(status if status > 0 else 128 - status)


def works() -> bool:
    """Is there a virtual environment that was made to its end?"""
    check = [PYTHON, "-c", "import sys, pip; sys.exit(sys.version_info < (3, 11))"]
    return os.path.exists(PYTHON) and subprocess.call(check, stderr=subprocess.DEVNULL) == 0


def install(what: str) -> None:
    """Make the virtual environment unless it is there, and put the package into it."""
    if not works():
        print("Making", ENVIRONMENT, flush=True)
        call(sys.executable, "-m", "venv", "--clear", ENVIRONMENT)
    print("Installing", what, "(the first time takes a minute or two)", flush=True)
    call(PYTHON, "-m", "pip", "install", "-q", "--disable-pip-version-check", "-e", what)


def run() -> None:
    """The main job: three spin periods of the baseline sail, and its figures."""
    install(".")
    call(PYTHON, "-m", "esail_jax", "run", "baseline", "-o", "baseline.h5", "--resume")
    call(PYTHON, "-m", "esail_jax", "plot", "baseline.h5", "-o", "figures")
    print("Run file:", os.path.join(ROOT, "baseline.h5"))
    print("Figures: ", os.path.join(ROOT, "figures"))


def test(options: list) -> None:
    """The tests, on up to four cores: most of their time is compiling, which fills one each. A process
    starts with a stretch of neighbours, which share what was compiled, and then takes from the others'."""
    install(".[test]")
    call(PYTHON, "-m", "pytest", "-n", "auto", "--maxprocesses", "4", "--dist", "worksteal", *options)


if __name__ == "__main__":
    if sys.argv[1:] == ["run"]:
        run()
    elif sys.argv[1:2] == ["test"]:
        test(sys.argv[2:])
    else:
        asked = sys.argv[1:] in (["-h"], ["--help"])
        if sys.argv[1:2] == ["run"]:
            print(f"`run` must be given alone, but {sys.argv[2]} comes with it\n", file=sys.stderr)
        elif sys.argv[1:] and not asked:
            print(f"COMMAND must be run or test, but is {sys.argv[1]}\n", file=sys.stderr)
        print(__doc__, file=sys.stdout if asked else sys.stderr)
        sys.exit(0 if asked else 2)
