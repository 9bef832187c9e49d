-- What verdicts rest on: warnings, the runs' own drag-free residue, a number of runs that was fixed
-- before the first look. Sets PRAGMA user_version = 9.

-- The version of the schema that the file was made with.
ALTER TABLE campaign ADD COLUMN first_version INTEGER NOT NULL DEFAULT 8;

-- Runs that were asked for before the first result was there: the verdict about a requirement may
-- take their number as fixed. NULL: a stop rule ends the campaign, or an older program began it.
ALTER TABLE campaign ADD COLUMN num_runs_fixed INTEGER CHECK (num_runs_fixed > 0);

-- Completed runs of which an effect may have moved an estimate by a tenth of its objective or more,
-- computed with `statistic`: the first 1,000,000 rows. Empty if the campaign's model is older than
-- this version of the schema.
CREATE TABLE run_warning (
  run_index  INTEGER NOT NULL REFERENCES run_result (run_index),
  effect     TEXT NOT NULL,
  parameter  TEXT NOT NULL REFERENCES parameter (parameter),
  part       REAL NOT NULL CHECK (part > 0),  -- bound of the shift, in objectives
  PRIMARY KEY (run_index, effect, parameter)
) STRICT, WITHOUT ROWID;

-- One row an effect and parameter.
CREATE VIEW warnings AS
SELECT effect, parameter, count(*) AS num_runs, max(part) AS largest_part, run_index AS largest_run
FROM run_warning
GROUP BY effect, parameter
ORDER BY largest_part DESC;

-- Statistics are of completed runs from here on. Those of a file with runs that did not converge
-- are computed anew from its results; the largest errors are kept with the results, and made here.
-- The condition status <> 1 is that of the index of runs that are not completed.
DELETE FROM statistic WHERE EXISTS (SELECT 1 FROM run_result WHERE status <> 1 AND status = 2);
DELETE FROM budget_entry WHERE EXISTS (SELECT 1 FROM run_result WHERE status <> 1 AND status = 2);
DELETE FROM summary WHERE EXISTS (SELECT 1 FROM run_result WHERE status <> 1 AND status = 2);
DELETE FROM overrun
WHERE run_index IN (SELECT run_index FROM run_result WHERE status <> 1 AND status = 2);
DELETE FROM worst_run WHERE EXISTS (SELECT 1 FROM run_result WHERE status <> 1 AND status = 2);
INSERT INTO worst_run
SELECT parameter, run_index, magnitude
FROM (SELECT e.parameter, e.run_index, abs(e.error) AS magnitude,
             row_number() OVER (PARTITION BY e.parameter ORDER BY abs(e.error) DESC, e.run_index)
               AS place
      FROM error_long AS e JOIN run_result AS r USING (run_index)
      WHERE r.status = 1 AND EXISTS (SELECT 1 FROM run_result WHERE status <> 1 AND status = 2))
WHERE place <= 10;

-- Older programs took any table of a dispersion for independent draws. A column is that only if the
-- definition declares it, which it could not: no interval is true of these campaigns.
UPDATE statistic SET
  beyond_objective_lower = 0.0, beyond_objective_upper = 1.0, mean_lower = NULL, mean_upper = NULL,
  standard_deviation_lower = NULL, standard_deviation_upper = NULL,
  percentile_50_lower = NULL, percentile_50_upper = NULL,
  percentile_90_lower = NULL, percentile_90_upper = NULL,
  percentile_95_lower = NULL, percentile_95_upper = NULL,
  percentile_99_lower = NULL, percentile_99_upper = NULL, bias_lower = NULL, bias_upper = NULL,
  error_standard_deviation_lower = NULL, error_standard_deviation_upper = NULL
WHERE EXISTS (SELECT 1 FROM dispersion_value);
UPDATE summary SET within_objectives_lower = NULL, within_objectives_upper = NULL
WHERE EXISTS (SELECT 1 FROM dispersion_value);

-- In budget_coefficient, the level that `value` is for, and in proportion to; NULL where `value`
-- holds at any level of a run, and in files that were made before.
ALTER TABLE budget_coefficient ADD COLUMN assumed_level REAL CHECK (assumed_level > 0);

-- One row a completed run: the budget's total after its estimation, at its own level. The total of
-- the worst errors of all parameters is larger: no run has them all.
DROP VIEW run_budget;
CREATE VIEW run_budget AS
SELECT r.run_index, {budget_total_at_level} AS total_m_s2
FROM run_result AS r
WHERE r.status = 1;

PRAGMA user_version = 9;
