"""`python -m evidence.bracket`."""

from evidence.bracket.measured import main

if __name__ == "__main__":
    main()
