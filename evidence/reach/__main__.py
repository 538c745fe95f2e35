"""`python -m evidence.reach`."""

from evidence.reach.measured import main

if __name__ == "__main__":
    main()
