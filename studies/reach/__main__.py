"""`python -m studies.reach`."""

from studies.threads import one_thread

if __name__ == "__main__":
    one_thread()

    from studies.reach.measured import main

    main()
