"""The program: `distretarget`, or `python -m distretarget`."""

import gc
import sys


def main() -> None:
    """Run the command line. Ctrl-C ends it with status 130 also while it is still being imported."""
    try:
        from distretarget.cli import main as run

        run()
    except KeyboardInterrupt:
        sys.stderr.write("\ndistretarget: interrupted\n")  # below the ^C that a terminal shows
        sys.exit(130)
    finally:
        gc.freeze()  # or Python searches all objects for garbage when it exits, which takes a quarter of a short run


if __name__ == "__main__":
    main()
