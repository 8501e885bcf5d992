"""python -m tfarm: the command line."""

from tfarm.cli import main

if __name__ == "__main__":
    main()
