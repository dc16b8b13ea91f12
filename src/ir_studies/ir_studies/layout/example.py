"""The settings file that `ir study layout --example` prints."""

EXAMPLE = """\
format: ir_layout/1
cell: demo                   # bundled, or a file beside this one

# What may move, and how far from where it stands in the cell file. x, y, z: m along the axes of the cell;
# turn_deg: about its own vertical. A key that is left out does not move.
base: {x: [-0.3, 0.3], y: [-0.3, 0.3], z: [0, 0.2], turn_deg: [-20, 20]}
carried: []                  # machines that move with the base, as the pedestal below it
equipment:
  gauge: {x: [-0.3, 0.2], y: [-0.4, 0.4], turn_deg: [-20, 20]}
  outfeed: {x: [-0.2, 0.3], y: [-0.3, 0.3]}
park: {a1_deg: [-40, 40], a2_deg: [-5, 30]}   # joint angles, from those of the posture park
tool: {}                     # x, y, z in m, a_deg, b_deg, c_deg: its mounting, in the last link's frame

# What every placement is planned for; its cost is the mean over all of them.
cycle_times: [0]             # s; 0: free
payloads: {}                 # masses of parts in kg: {gear: [10, 20]}; {}: as in the cell file
stations: []                 # visited instead of the cell's program

method: spread               # or grid: `steps` values of every variable, all combined
placements: 200              # looked at: half of them spread over the ranges, the others near the best so far
steps: 5
rounds: 3                    # the ranges around the best are halved from round to round
keep: 5                      # of the best: written as cell files, planned with all seeds
seeds: 3
seed: 0                      # of the placements that are looked at
plans: 0                     # placements that are planned in full, at most; 0: as many as could be the best
margin: 0.01                 # share of the cost by which a placement may be better than its bound says

time_value: 500.0            # W in J = energy of the drives + time_value x T, without a cycle time
safety_distance: 0.02        # m
max_iterations: 0            # work of a plan; 0: the planner's default
hang_after: 600.0            # s after which a job is cut
"""  # noqa: E501
