"""Controllers of a given structure: named gains, found by descent on the largest closed-loop
gain.
"""
