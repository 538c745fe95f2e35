"""`python -m studies.bracket`."""

from studies.bracket.measured import main

if __name__ == "__main__":
    main()
