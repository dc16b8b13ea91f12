"""Where a motion is being played: it runs in a circle, at a speed, until it is stopped."""

from __future__ import annotations

from .motion import Motion, Step


class Playback:
    """A motion and the time [s] at which it stands."""

    def __init__(self, motion: Motion | None = None) -> None:
        self.motion = motion
        self.time = 0.0
        self.runs = False

    @property
    def sample(self) -> int:
        """The sample that is shown."""
        return 0 if self.motion is None else self.motion.at(self.time)

    @property
    def step(self) -> Step | None:
        """The step that is shown."""
        return (
            None if self.motion is None else self.motion.steps[int(self.motion.step[self.sample])]
        )

    def advance(self, seconds: float) -> None:
        """Go on by so many seconds; after the end from the beginning."""
        if self.motion is not None and self.motion.duration > 0.0:
            self.time = (self.time + seconds) % self.motion.duration
