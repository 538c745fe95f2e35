"""`python -m studies.jerk`."""

from studies.threads import one_thread

if __name__ == "__main__":
    one_thread()

    from studies.jerk.measured import main

    main()
