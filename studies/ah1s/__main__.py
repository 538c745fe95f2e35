"""`python -m studies.ah1s`."""

from studies.threads import one_thread

if __name__ == "__main__":
    one_thread()

    from studies.ah1s.compared import main

    main()
