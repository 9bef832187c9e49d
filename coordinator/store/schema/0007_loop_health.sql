-- How well the loops held each run, and runs that are lost. Sets PRAGMA user_version = 7.

-- `status` gains 5, lost, so the table is made anew. What refers to its rows is checked at the end.
PRAGMA defer_foreign_keys = ON;

CREATE TABLE run_result_before AS SELECT run_index, status, num_draws, num_rounds,
  truth_a_c11_delta_x_m, truth_a_c11_delta_z_m, truth_a_c11_delta_y_m,
  truth_a_c12_rad, truth_a_c13_rad, truth_a_d11_prime,
  truth_a_d12_rad, truth_a_d13_rad, truth_k2d_s2_m,
  truth_k2c_s2_m, estimate_a_c11_delta_x_m, estimate_a_c11_delta_z_m,
  estimate_a_c11_delta_y_m, estimate_a_c12_rad, estimate_a_c13_rad,
  estimate_a_d11_prime, estimate_a_d12_rad, estimate_a_d13_rad,
  estimate_k2d_s2_m, estimate_k2c_s2_m
FROM run_result;

DROP TABLE run_result;

-- One row a finished run, with what depends on campaign and run alone: two files of one campaign
-- hold the same rows. Insert with ON CONFLICT DO NOTHING: a second delivery changes nothing.
--   truth_     of the drawn instrument, NULL if no draw was acceptable (status 4)
--   estimate_  of the calibration, NULL unless it came to an end (status 1 and 2)
--   error_     estimate - truth, computed when read
--   health_    of the loops, NULL if no draw was acceptable and in rows from before version 7
--   loss_      why and in which session a run was lost, NULL unless it was (status 5)
CREATE TABLE run_result (
  run_index   INTEGER PRIMARY KEY CHECK (run_index >= 0),
  -- 1 completed, 2 not converged, 3 not finite, 4 no draw, 5 lost
  status      INTEGER NOT NULL CHECK (status BETWEEN 1 AND 5),
  num_draws   INTEGER NOT NULL CHECK (num_draws >= 0),
  num_rounds  INTEGER NOT NULL CHECK (num_rounds >= 0),

  truth_a_c11_delta_x_m REAL CHECK ((truth_a_c11_delta_x_m IS NULL) = (status = 4)),
  truth_a_c11_delta_z_m REAL CHECK ((truth_a_c11_delta_z_m IS NULL) = (status = 4)),
  truth_a_c11_delta_y_m REAL CHECK ((truth_a_c11_delta_y_m IS NULL) = (status = 4)),
  truth_a_c12_rad       REAL CHECK ((truth_a_c12_rad IS NULL) = (status = 4)),
  truth_a_c13_rad       REAL CHECK ((truth_a_c13_rad IS NULL) = (status = 4)),
  truth_a_d11_prime     REAL CHECK ((truth_a_d11_prime IS NULL) = (status = 4)),
  truth_a_d12_rad       REAL CHECK ((truth_a_d12_rad IS NULL) = (status = 4)),
  truth_a_d13_rad       REAL CHECK ((truth_a_d13_rad IS NULL) = (status = 4)),
  truth_k2d_s2_m        REAL CHECK ((truth_k2d_s2_m IS NULL) = (status = 4)),
  truth_k2c_s2_m        REAL CHECK ((truth_k2c_s2_m IS NULL) = (status = 4)),

  estimate_a_c11_delta_x_m REAL CHECK ((estimate_a_c11_delta_x_m IS NULL) = (status > 2)),
  estimate_a_c11_delta_z_m REAL CHECK ((estimate_a_c11_delta_z_m IS NULL) = (status > 2)),
  estimate_a_c11_delta_y_m REAL CHECK ((estimate_a_c11_delta_y_m IS NULL) = (status > 2)),
  estimate_a_c12_rad       REAL CHECK ((estimate_a_c12_rad IS NULL) = (status > 2)),
  estimate_a_c13_rad       REAL CHECK ((estimate_a_c13_rad IS NULL) = (status > 2)),
  estimate_a_d11_prime     REAL CHECK ((estimate_a_d11_prime IS NULL) = (status > 2)),
  estimate_a_d12_rad       REAL CHECK ((estimate_a_d12_rad IS NULL) = (status > 2)),
  estimate_a_d13_rad       REAL CHECK ((estimate_a_d13_rad IS NULL) = (status > 2)),
  estimate_k2d_s2_m        REAL CHECK ((estimate_k2d_s2_m IS NULL) = (status > 2)),
  estimate_k2c_s2_m        REAL CHECK ((estimate_k2c_s2_m IS NULL) = (status > 2)),

  error_a_c11_delta_x_m REAL AS (estimate_a_c11_delta_x_m - truth_a_c11_delta_x_m),
  error_a_c11_delta_z_m REAL AS (estimate_a_c11_delta_z_m - truth_a_c11_delta_z_m),
  error_a_c11_delta_y_m REAL AS (estimate_a_c11_delta_y_m - truth_a_c11_delta_y_m),
  error_a_c12_rad       REAL AS (estimate_a_c12_rad - truth_a_c12_rad),
  error_a_c13_rad       REAL AS (estimate_a_c13_rad - truth_a_c13_rad),
  error_a_d11_prime     REAL AS (estimate_a_d11_prime - truth_a_d11_prime),
  error_a_d12_rad       REAL AS (estimate_a_d12_rad - truth_a_d12_rad),
  error_a_d13_rad       REAL AS (estimate_a_d13_rad - truth_a_d13_rad),
  error_k2d_s2_m        REAL AS (estimate_k2d_s2_m - truth_k2d_s2_m),
  error_k2c_s2_m        REAL AS (estimate_k2c_s2_m - truth_k2c_s2_m),

  health_acceleration_m_s2 REAL,  -- largest measured one of a sensor, before its range ends it
  health_attitude_rad      REAL,  -- largest angle that the attitude loop had to remove
  health_residual_m_s2     REAL,  -- measured acceleration at the test frequency
  health_quadratic_noise   REAL,  -- noise of the quadratic terms over the sensors', in power
  health_square_noise      REAL,  -- noise of a squared measurement over its line, in power

  -- 1 saturation, 2 attitude, 3 residual, 4 quadratic noise, 5 square noise
  loss_cause    INTEGER CHECK (loss_cause BETWEEN 1 AND 5)
                        CHECK ((loss_cause IS NULL) = (status <> 5)),
  -- 1 to 12: a_c11_delta_x, a_c11_delta_z, a_c11_delta_y, a_c12, a_c13, a_d11_prime, a_d12, a_d13,
  -- k2d, k2_sensor_1, k2_sensor_2, no_target
  loss_session  INTEGER CHECK (loss_session BETWEEN 1 AND 12)
                        CHECK ((loss_session IS NULL) = (status <> 5))
) STRICT;

INSERT INTO run_result (run_index, status, num_draws, num_rounds,
  truth_a_c11_delta_x_m, truth_a_c11_delta_z_m, truth_a_c11_delta_y_m,
  truth_a_c12_rad, truth_a_c13_rad, truth_a_d11_prime,
  truth_a_d12_rad, truth_a_d13_rad, truth_k2d_s2_m,
  truth_k2c_s2_m, estimate_a_c11_delta_x_m, estimate_a_c11_delta_z_m,
  estimate_a_c11_delta_y_m, estimate_a_c12_rad, estimate_a_c13_rad,
  estimate_a_d11_prime, estimate_a_d12_rad, estimate_a_d13_rad,
  estimate_k2d_s2_m, estimate_k2c_s2_m)
SELECT run_index, status, num_draws, num_rounds,
  truth_a_c11_delta_x_m, truth_a_c11_delta_z_m, truth_a_c11_delta_y_m,
  truth_a_c12_rad, truth_a_c13_rad, truth_a_d11_prime,
  truth_a_d12_rad, truth_a_d13_rad, truth_k2d_s2_m,
  truth_k2c_s2_m, estimate_a_c11_delta_x_m, estimate_a_c11_delta_z_m,
  estimate_a_c11_delta_y_m, estimate_a_c12_rad, estimate_a_c13_rad,
  estimate_a_d11_prime, estimate_a_d12_rad, estimate_a_d13_rad,
  estimate_k2d_s2_m, estimate_k2c_s2_m
FROM run_result_before;

DROP TABLE run_result_before;

CREATE INDEX run_result_not_completed ON run_result (status) WHERE status <> 1;

ALTER TABLE summary ADD COLUMN num_lost INTEGER NOT NULL DEFAULT 0 CHECK (num_lost >= 0);

-- SHA-256 (hexadecimal) of the columns health_ and loss_ of all results, as report/digest.hpp lays
-- them out; empty if none has any.
ALTER TABLE summary ADD COLUMN health_digest TEXT NOT NULL DEFAULT ''
  CHECK (length(health_digest) IN (0, 64));

DROP VIEW campaign_progress;

CREATE VIEW campaign_progress AS
WITH counts AS (
  SELECT (SELECT count(*) FROM delivery) AS num_finished,
         (SELECT count(*) FROM run_failure) AS num_given_up
)
SELECT c.name AS campaign, c.phase, c.num_runs, n.num_finished, n.num_given_up,
       c.num_runs - n.num_finished - n.num_given_up AS num_open,
       (SELECT count(*) FROM run_result WHERE status <> 1 AND status = 2) AS num_not_converged,
       (SELECT count(*) FROM run_result WHERE status <> 1 AND status = 3) AS num_not_finite,
       (SELECT count(*) FROM run_result WHERE status <> 1 AND status = 4) AS num_no_draw,
       (SELECT count(*) FROM run_result WHERE status <> 1 AND status = 5) AS num_lost,
       (SELECT count(*) FROM audit) AS num_compared,
       (SELECT count(*) FROM audit WHERE NOT is_equal) AS num_contradicting,
       (SELECT strftime('%Y-%m-%dT%H:%M:%SZ', max(last_result_unix_s), 'unixepoch') FROM worker)
         AS last_result_utc
FROM campaign AS c, counts AS n;

-- One row a run that has a draw.
CREATE VIEW loop_health AS
SELECT run_index,
       CASE status WHEN 1 THEN 'completed' WHEN 2 THEN 'not_converged' WHEN 3 THEN 'not_finite'
         WHEN 5 THEN 'lost' END AS status,
       health_acceleration_m_s2 AS acceleration_m_s2, health_attitude_rad AS attitude_rad,
       health_residual_m_s2 AS residual_m_s2, health_quadratic_noise AS quadratic_noise,
       health_square_noise AS square_noise,
       CASE loss_cause WHEN 1 THEN 'saturation' WHEN 2 THEN 'attitude' WHEN 3 THEN 'residual'
         WHEN 4 THEN 'quadratic_noise' WHEN 5 THEN 'square_noise' END AS loss_cause,
       CASE loss_session WHEN 1 THEN 'a_c11_delta_x' WHEN 2 THEN 'a_c11_delta_z'
         WHEN 3 THEN 'a_c11_delta_y' WHEN 4 THEN 'a_c12' WHEN 5 THEN 'a_c13'
         WHEN 6 THEN 'a_d11_prime' WHEN 7 THEN 'a_d12' WHEN 8 THEN 'a_d13' WHEN 9 THEN 'k2d'
         WHEN 10 THEN 'k2_sensor_1' WHEN 11 THEN 'k2_sensor_2'
         WHEN 12 THEN 'no_target' END AS loss_session
FROM run_result
WHERE status <> 4
ORDER BY run_index;

PRAGMA user_version = 7;
