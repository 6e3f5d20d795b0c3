"""Work of a render's thread that only Blender's main thread may do."""

import threading

# Seconds between looks at whether the user cancels.
_POLL = 0.05


class Cancelled(Exception):
    """The user cancels."""


def run(work, schedule, is_cancelled):
    """Has the main thread do some work, by a function that schedules calls of it, and returns the work's result.

    A user who cancels makes the main thread wait for that of the render, so that the work may never begin: then it raises
    Cancelled, and the work is not done later."""
    result, error = None, None
    begun = abandoned = False
    lock, done = threading.Lock(), threading.Event()

    def call():
        nonlocal result, error, begun
        with lock:
            if abandoned:
                return
            begun = True
        try:
            result = work()
        except Exception as raised:
            error = raised
        done.set()

    schedule(call)
    while not done.wait(_POLL):
        if is_cancelled():
            with lock:
                if not begun:
                    abandoned = True
                    raise Cancelled
    if error:
        raise error
    return result
