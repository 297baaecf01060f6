"""What has become of the self-test at boot."""

# What has become of the self-test at boot.
NOT_RUN, RUNNING, PASSED, FAILED, SKIPPED = range(5)
OUTCOMES = (
    (NOT_RUN, "not_run", "this board has none"),
    (RUNNING, "running", "under way"),
    (PASSED, "passed", "every sensor and valve works"),
    (FAILED, "failed", "some do not, see the bits"),
    (SKIPPED, "skipped", "valves not tested: no supply pressure, an emergency stop, or a SHOW came first"),
)
