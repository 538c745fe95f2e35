"""`python -m evidence.marks`."""

from evidence.marks.measured import main

if __name__ == "__main__":
    main()
