"""`python -m evidence.ah1s`."""

from evidence.ah1s.compared import main

if __name__ == "__main__":
    main()
