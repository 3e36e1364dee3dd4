"""Degraded footage: copies of a clip as bad cameras, bad days and other people's edits deliver it, each with its truth.

    CASES                  what can be done to a clip, by name, with the error that is wanted at most
    write(clip, case, …)   the copy on disk, its truth and its region

light, sharpness, cover and surroundings change pictures; camera turns them, and the truth with them; storage writes them.
"""
