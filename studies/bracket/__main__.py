"""`python -m studies.bracket`."""

from studies.threads import one_thread

if __name__ == "__main__":
    one_thread()

    from studies.bracket.measured import main

    main()
