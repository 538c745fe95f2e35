"""Checks a saved proof from its definition alone: exact arithmetic, the standard library, no other
part of this repository.

    python synthesis/checker FILE

prints what the numbers of the file claim and under which hypotheses, and decides. Exit status: 0
proven, 1 not proven, 2 a file that cannot be read or a kind of claim that is not known. A copy of
this folder alone does the same. The definitions are those of docs/mathematics.md.
"""
