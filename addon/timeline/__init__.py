# SPDX-License-Identifier: GPL-3.0-or-later
"""Playing and scrubbing: frames are computed while the timeline moves forward, kept in memory and shown.

:mod:`.playback` decides what happens at a frame; :mod:`.live_cache` holds the run; :mod:`.baked_frames` and :mod:`.staleness`
show the numbers of a bake and check whether it is out of date. :mod:`.second_look` does so when something else than the frame
changes.
"""

__all__ = ["baked_frames", "live_cache", "playback", "second_look", "staleness"]
