"""Waiting for a condition, with a deadline."""

import time

# Only what hangs takes so long: no test becomes right or wrong by it.
PATIENCE_S = 60.0


def wait_until(condition, what, patience_s=PATIENCE_S, pause_s=0.02):
    """Asks until the answer is true and returns it; AssertionError with `what` when the time is up."""
    deadline = time.monotonic() + patience_s
    while True:
        answer = condition()
        if answer:
            return answer
        if time.monotonic() >= deadline:
            raise AssertionError(f"not within {patience_s} s: {what}")
        time.sleep(pause_s)
