import sys, time
from tools.research.faults.virtual_cells import fly_all, ALL
from tools.research.faults.goals import missed
t=time.time()
pick=[c for c in ALL if all(w in f"{c.mode.name}/{c.fault.name}" for w in sys.argv[1:])]
for cell, f in fly_all(pick, 2):
    n=lambda x: "-" if x is None else f"{x:.3f}"
    print(f"{cell.mode.name:16}{cell.fault.name:32} depth {n(f.depth_error)} jerk {n(f.jerk_ratio)} stale {f.stale} lost {n(f.pilot_lost)} zero {n(f.thrust_zero)} back {n(f.recovered)} dis {n(f.disarmed)} ann {n(f.announced)} {f.failsafes} {f.texts[:6]} MISSED {missed(cell.fault,f)}", flush=True)
print(len(pick), time.time()-t)
