"""The program: `distretarget`, or `python -m distretarget`."""

import gc
import sys


def main() -> None:
    """Run the command line. Ctrl-C exits with status 130, even while modules are being imported."""
    try:
        from distretarget.cli import main as run

        run()
    except KeyboardInterrupt:
        sys.stderr.write("\ndistretarget: interrupted\n")  # below the ^C that a terminal shows
        sys.exit(130)
    finally:
        gc.freeze()  # skips the garbage collection at exit, a quarter of the time of a short run


if __name__ == "__main__":
    main()
