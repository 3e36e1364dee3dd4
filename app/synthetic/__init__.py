"""Hard videos and tracks with their truth: made-up things that bend, turn or swell, each by its kind and seed.

    scene(kind, seed)      one of catalog.KINDS: where its surface is, frame by frame
    tracks(scene)          points on it as `modeshape evaluate` takes them, with noise, gaps and gross errors
    write_video(scene, …)  pictures of it as `modeshape run` takes them, with the truth

sheet, solid and cloth are shapes; path is how they are turned; nothing here is loaded by a run.
"""
