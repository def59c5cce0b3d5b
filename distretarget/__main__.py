"""`python -m distretarget`."""

from distretarget.cli import main

if __name__ == "__main__":
    main()
