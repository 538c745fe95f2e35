"""`python -m studies.marks`."""

from studies.threads import one_thread

if __name__ == "__main__":
    one_thread()

    from studies.marks.measured import main

    main()
