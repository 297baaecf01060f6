"""What has become of the sequence in memory, how steps end, what is told and what can be asked of it."""

# What has become of the sequence in memory.
EMPTY, LOADING, ARMED, WAITING, PLAYING, PAUSED, ENDED = range(7)
STATES = (
    (EMPTY, "empty", "there is none"),
    (LOADING, "loading", "records are awaited"),
    (ARMED, "armed", "checked, may be started"),
    (WAITING, "waiting", "will start at its tick"),
    (PLAYING, "playing", "its steps are executed"),
    (PAUSED, "paused", "its time stands still, the setpoints too"),
    (ENDED, "ended", "see the reason; may be armed again, if it was no stream"),
)

# How a step or the whole sequence ended.
UNENDED, BY_TIME, BY_SETTLING, BY_TIMEOUT, COMPLETE, CANCELLED, UNDERRUN = range(7)
REASONS = (
    (UNENDED, "unended", "it has not"),
    (BY_TIME, "by_time", "its time had come"),
    (BY_SETTLING, "by_settling", "every bubble was within the tolerance"),
    (BY_TIMEOUT, "by_timeout", "the bubbles named in unsettled were not, until its timeout"),
    (COMPLETE, "complete", "all steps have been played"),
    (CANCELLED, "cancelled", "SHOW, STOP, VENT, another sequence or a fault that vents came"),
    (UNDERRUN, "underrun", "the next record of a stream had not come: the last shape is held"),
)

# What SEQUENCE_EVENT tells.
STEP_BEGUN, SEQUENCE_PAUSED, SEQUENCE_RESUMED, SEQUENCE_ENDED = range(4)
EVENTS = (
    (STEP_BEGUN, "step_begun", "a step begins; reason and unsettled are those of the step before it"),
    (SEQUENCE_PAUSED, "sequence_paused", "time stands still"),
    (SEQUENCE_RESUMED, "sequence_resumed", "and goes on"),
    (SEQUENCE_ENDED, "sequence_ended", "reason says why; unsettled is the last step's"),
)

# What SEQUENCE_CONTROL does.
PAUSE, RESUME, END = range(3)
ACTIONS = (
    (PAUSE, "pause", "let its time and the setpoints stand still"),
    (RESUME, "resume", "go on from there"),
    (END, "end", "end it as STOP does"),
)
