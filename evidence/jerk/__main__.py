"""`python -m evidence.jerk`."""

from evidence.jerk.measured import main

if __name__ == "__main__":
    main()
