-- Statistics with their intervals, the runs that stand out, when to stop, and what people add.
-- Sets PRAGMA user_version = 5.

DROP VIEW parameter_accuracy;

-- As before, and more; unit as in parameter. _lower and _upper bound a 95 % interval: NULL if runs
-- are too few for one. Of rows from before version 5 only the first seven numbers are known.
CREATE TABLE statistic_with_intervals (
  parameter             TEXT PRIMARY KEY REFERENCES parameter (name),
  num_runs              INTEGER NOT NULL CHECK (num_runs > 0),

  -- |estimate - truth|
  worst                     REAL NOT NULL,
  worst_run_index           INTEGER NOT NULL,
  num_beyond_objective      INTEGER NOT NULL,
  mean                      REAL NOT NULL,
  mean_lower                REAL,              -- by Student's law
  mean_upper                REAL,
  standard_deviation        REAL NOT NULL,
  standard_deviation_lower  REAL,              -- by the bootstrap
  standard_deviation_upper  REAL,
  percentile_50             REAL,
  percentile_50_lower       REAL,              -- by order statistics
  percentile_50_upper       REAL,
  percentile_90             REAL,
  percentile_90_lower       REAL,
  percentile_90_upper       REAL,
  percentile_95             REAL,
  percentile_95_lower       REAL,
  percentile_95_upper       REAL,
  percentile_99             REAL,
  percentile_99_lower       REAL,
  percentile_99_upper       REAL,

  -- estimate - truth, with its sign
  bias                            REAL,
  bias_lower                      REAL,        -- by Student's law
  bias_upper                      REAL,
  rms                             REAL,
  error_standard_deviation        REAL,
  error_standard_deviation_lower  REAL,        -- by the chi-square law: for normal errors
  error_standard_deviation_upper  REAL,
  skewness                        REAL         -- a number
) STRICT;

INSERT INTO statistic_with_intervals (parameter, num_runs, worst, worst_run_index,
                                      num_beyond_objective, mean, standard_deviation)
SELECT parameter, num_runs, worst, worst_run_index, num_beyond_objective, mean, standard_deviation
FROM statistic;

DROP TABLE statistic;
ALTER TABLE statistic_with_intervals RENAME TO statistic;

-- What `statistic` was computed from.
CREATE TABLE summary (
  summary_id         INTEGER PRIMARY KEY CHECK (summary_id = 1),
  num_finished       INTEGER NOT NULL,
  num_estimated      INTEGER NOT NULL,  -- completed or not converged
  num_not_converged  INTEGER NOT NULL,
  num_not_finite     INTEGER NOT NULL,
  num_no_draw        INTEGER NOT NULL,
  num_given_up       INTEGER NOT NULL,  -- not among the finished ones
  digest             TEXT NOT NULL CHECK (length(digest) = 64),  -- SHA-256, hexadecimal
  computed_utc       TEXT NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%SZ', 'now'))
) STRICT;

-- Words by which people find a campaign, and what they have to say of it.
CREATE TABLE tag (
  tag        TEXT PRIMARY KEY CHECK (length(tag) BETWEEN 1 AND 64),
  added_utc  TEXT NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%SZ', 'now'))
) STRICT, WITHOUT ROWID;

CREATE TABLE note (
  note_id   INTEGER PRIMARY KEY,
  time_utc  TEXT NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%SZ', 'now')),
  text      TEXT NOT NULL CHECK (length(CAST(text AS BLOB)) BETWEEN 1 AND 2000)
) STRICT;

-- When a campaign ends before all of its runs are finished.
ALTER TABLE campaign ADD COLUMN stop_rule TEXT NOT NULL DEFAULT '';  -- empty: none
ALTER TABLE campaign ADD COLUMN num_runs_max INTEGER CHECK (num_runs_max > 0);  -- whatever the rule
ALTER TABLE campaign ADD COLUMN failures_max INTEGER CHECK (failures_max >= 0);  -- then it stops

-- The rule against the runs below num_runs, each time that so many were finished.
CREATE TABLE stop_check (
  statistic            TEXT NOT NULL,                          -- `std(a_c13)`
  num_runs             INTEGER NOT NULL CHECK (num_runs > 0),
  estimate             REAL NOT NULL,                          -- unit as in parameter
  lower                REAL,                                   -- 95 %; NULL if runs are too few
  upper                REAL,
  relative_half_width  REAL,
  is_reached           INTEGER NOT NULL CHECK (is_reached IN (0, 1)),
  checked_utc          TEXT NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%SZ', 'now')),
  PRIMARY KEY (statistic, num_runs)
) STRICT, WITHOUT ROWID;

CREATE VIEW parameter_accuracy AS
SELECT p.name AS parameter, p.unit, p.objective,
       s.num_runs, s.worst, s.worst_run_index, s.num_beyond_objective,
       s.mean, s.mean_lower, s.mean_upper,
       s.standard_deviation, s.standard_deviation_lower, s.standard_deviation_upper,
       s.percentile_50, s.percentile_50_lower, s.percentile_50_upper,
       s.percentile_90, s.percentile_90_lower, s.percentile_90_upper,
       s.percentile_95, s.percentile_95_lower, s.percentile_95_upper,
       s.percentile_99, s.percentile_99_lower, s.percentile_99_upper,
       s.bias, s.bias_lower, s.bias_upper, s.rms,
       s.error_standard_deviation, s.error_standard_deviation_lower,
       s.error_standard_deviation_upper, s.skewness,
       p.paper_worst, p.paper_mean, p.paper_standard_deviation
FROM parameter AS p LEFT JOIN statistic AS s ON s.parameter = p.name
ORDER BY p.position;

-- One row a run and parameter.
CREATE VIEW error_long AS
SELECT r.run_index, p.name AS parameter, p.unit,
       CASE p.position
         WHEN 1 THEN r.truth_a_c11_delta_x_m
         WHEN 2 THEN r.truth_a_c11_delta_z_m
         WHEN 3 THEN r.truth_a_c11_delta_y_m
         WHEN 4 THEN r.truth_a_c12_rad
         WHEN 5 THEN r.truth_a_c13_rad
         WHEN 6 THEN r.truth_a_d11_prime
         WHEN 7 THEN r.truth_a_d12_rad
         WHEN 8 THEN r.truth_a_d13_rad
         WHEN 9 THEN r.truth_k2d_s2_m
         WHEN 10 THEN r.truth_k2c_s2_m
       END AS truth,
       CASE p.position
         WHEN 1 THEN r.estimate_a_c11_delta_x_m
         WHEN 2 THEN r.estimate_a_c11_delta_z_m
         WHEN 3 THEN r.estimate_a_c11_delta_y_m
         WHEN 4 THEN r.estimate_a_c12_rad
         WHEN 5 THEN r.estimate_a_c13_rad
         WHEN 6 THEN r.estimate_a_d11_prime
         WHEN 7 THEN r.estimate_a_d12_rad
         WHEN 8 THEN r.estimate_a_d13_rad
         WHEN 9 THEN r.estimate_k2d_s2_m
         WHEN 10 THEN r.estimate_k2c_s2_m
       END AS estimate,
       CASE p.position
         WHEN 1 THEN r.error_a_c11_delta_x_m
         WHEN 2 THEN r.error_a_c11_delta_z_m
         WHEN 3 THEN r.error_a_c11_delta_y_m
         WHEN 4 THEN r.error_a_c12_rad
         WHEN 5 THEN r.error_a_c13_rad
         WHEN 6 THEN r.error_a_d11_prime
         WHEN 7 THEN r.error_a_d12_rad
         WHEN 8 THEN r.error_a_d13_rad
         WHEN 9 THEN r.error_k2d_s2_m
         WHEN 10 THEN r.error_k2c_s2_m
       END AS error
FROM run_result AS r JOIN parameter AS p
WHERE r.status <= 2;

-- Runs with an |error| above the objective of a parameter; kept with the results, as a million of
-- these cannot be searched in a moment.
CREATE TABLE overrun (
  run_index   INTEGER PRIMARY KEY REFERENCES run_result (run_index),
  parameters  INTEGER NOT NULL CHECK (parameters > 0)  -- bit n: the one at position n + 1
) STRICT;

INSERT INTO overrun
SELECT e.run_index, sum(1 << (p.position - 1))
FROM error_long AS e JOIN parameter AS p ON p.name = e.parameter
WHERE abs(e.error) > p.objective
GROUP BY e.run_index;

-- The ten runs with the largest |error| of each parameter; of equal ones the first. Kept likewise.
CREATE TABLE worst_run (
  parameter  TEXT NOT NULL REFERENCES parameter (name),
  run_index  INTEGER NOT NULL REFERENCES run_result (run_index),
  magnitude  REAL NOT NULL CHECK (magnitude >= 0),  -- |error|, unit as in parameter
  PRIMARY KEY (parameter, run_index)
) STRICT, WITHOUT ROWID;

INSERT INTO worst_run
SELECT p.name, e.run_index, abs(e.error)
FROM parameter AS p CROSS JOIN error_long AS e
WHERE e.parameter = p.name
  AND e.run_index IN (SELECT i.run_index FROM error_long AS i WHERE i.parameter = p.name
                      ORDER BY abs(i.error) DESC, i.run_index LIMIT 10);

CREATE VIEW worst_runs AS
SELECT w.parameter,
       row_number() OVER (PARTITION BY p.position ORDER BY w.magnitude DESC, w.run_index) AS place,
       w.run_index, p.unit, e.truth, e.estimate, e.error, w.magnitude / p.objective AS ratio
FROM worst_run AS w
  JOIN parameter AS p ON p.name = w.parameter
  JOIN error_long AS e ON e.run_index = w.run_index AND e.parameter = w.parameter
ORDER BY p.position, place;

CREATE VIEW overruns AS
SELECT o.run_index, p.name AS parameter, p.unit, p.objective,
       CASE p.position
         WHEN 1 THEN r.error_a_c11_delta_x_m
         WHEN 2 THEN r.error_a_c11_delta_z_m
         WHEN 3 THEN r.error_a_c11_delta_y_m
         WHEN 4 THEN r.error_a_c12_rad
         WHEN 5 THEN r.error_a_c13_rad
         WHEN 6 THEN r.error_a_d11_prime
         WHEN 7 THEN r.error_a_d12_rad
         WHEN 8 THEN r.error_a_d13_rad
         WHEN 9 THEN r.error_k2d_s2_m
         WHEN 10 THEN r.error_k2c_s2_m
       END AS error,
       abs(CASE p.position
         WHEN 1 THEN r.error_a_c11_delta_x_m
         WHEN 2 THEN r.error_a_c11_delta_z_m
         WHEN 3 THEN r.error_a_c11_delta_y_m
         WHEN 4 THEN r.error_a_c12_rad
         WHEN 5 THEN r.error_a_c13_rad
         WHEN 6 THEN r.error_a_d11_prime
         WHEN 7 THEN r.error_a_d12_rad
         WHEN 8 THEN r.error_a_d13_rad
         WHEN 9 THEN r.error_k2d_s2_m
         WHEN 10 THEN r.error_k2c_s2_m
       END) / p.objective AS ratio
FROM overrun AS o
  JOIN parameter AS p ON (o.parameters >> (p.position - 1)) & 1
  LEFT JOIN run_result AS r ON r.run_index = o.run_index;

PRAGMA user_version = 5;
