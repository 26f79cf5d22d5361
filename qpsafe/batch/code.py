"""Numbers by which kernels find things in a batch's blocks, see `qpsafe.batch.blocks`."""

from __future__ import annotations

from qpsafe.recovery.return_kernel import DURATION as DURATION
from qpsafe.recovery.return_kernel import KNOWN as KNOWN
from qpsafe.recovery.return_kernel import PENDING as PENDING
from qpsafe.recovery.return_kernel import RETURNING as RETURNING
from qpsafe.recovery.return_kernel import SINCE as SINCE

#: Joints, tasks, trajectories, spots, rows of all tasks, levels of danger, knots and events of all trajectories,
#: floats of the robot's kinematics, links of its wire, floats and integers of the solver, of the solids that it keeps
#: clear of and of the rows that this takes, and how many rows there may be; of the gate its
#: floats, integers, what it remembers, what it works in without points, capsules.
(JOINTS, TASKS, PATHS, SPOTS, ROWS, LEVELS, KNOTS, EVENTS, MEMORY, LINKS, SOLVER, SOLVER_WHOLE, SOLIDS, SOLIDS_WHOLE,
 CLEARANCE, CLEARANCE_WHOLE, ROOM, GATE, GATE_WHOLE, GATE_KNOWN, GATE_WORK, CAPSULES) = range(22)  # fmt: skip
HEADS = 22

#: Numbers of the rules and the law: first those of `qpsafe.recovery.return_kernel`.
(DT, KEPT, SPEED, ANGULAR_SPEED, JOINT_SPEED, SHORTEST, SUSPEND, STEP, TOLERANCE, FAR, CAP, DAMPING, DAMPING_TIME,
 WAY_DAMPING, WAY_DAMPING_TIME, WAY_GAIN, RETURN_SPEED, CALM, DWELL) = range(19)  # fmt: skip
#: Whole ones: whether paths are suspended at all, looks of the stall watch and ticks between two, ticks between two
#: looks at units, how many spots may be out of order, rows of the largest level, of a way back through the joints too,
#: the law's number in `qpsafe.laws.kinds`, and whether tasks are held while they are suspended.
ENABLED, PATIENCE, EVERY, UNITS_EVERY, MOST, LARGEST, LARGEST_WAY, LAW, HELD = range(9)
#: Kinds of trajectories: one pose; at rest after its end; begun again at its end; known up to its end.
FIXED, RESTS, CYCLES, ENDS = range(4)
#: Floats of a knot of a trajectory: pose, twist, turn to the next knot and the turn's rate there.
POSE, TWIST, TURN, TURN_RATE, KNOT = 0, 16, 22, 25, 28

#: A robot's clock: time on the path, rate, how long danger has been small.
TIME, RATE, QUIET = range(3)
#: A robot's marks.
(SEQ, ACTIVE, CHANGED, PAUSED, PHASE, STATUS, REASON, NOTES, WAITS, KEPT_LEVELS, LED, WAY, WAY_PHASE, WAY_CHANGED,
 MET_KNOWN, COMPARED_VALUES, STOPPED, DYING, OUT, UNIT_TICKS, FAR_POINTS, ODD, CAPPED, COUNT) = range(24)  # fmt: skip
#: What a tick came to.
CDF_N, M, F = range(3)

#: How a tick is told what is near: by readings of the spots, by points, by nothing (which is not silence).
DISTANCES, POINTS, NOTHING = range(3)
OK, DEGRADED, BAD_INPUT, FAULT = range(4)
#: Why a robot brakes.
(NO_REASON, NO_MEASUREMENT, NOTHING_GIVEN, NO_SPOTS, WRONG_SIZE, OUT_OF_ORDER, POINT_NOT_FINITE, DANGER_NOT_FINITE,
 LAW_ABSURD, PATH_UNKNOWN) = range(10)  # fmt: skip
#: What is unusual about a tick that goes on, in bits; what the stall watch says stands above them.
(LIMIT_GAVE_WAY, LAW_EXCEEDED, NOT_SOLVED, SENSORS_SICK, ODD_UNITS, TOO_NEAR, TOO_LONG, STALL) = (
    1, 2, 4, 8, 16, 32, 64, 128,
)  # fmt: skip
