-- Results of runs and who delivered them. Sets PRAGMA user_version = 2.

-- One row a finished run, with what depends on campaign and run alone: two files of one campaign
-- hold the same rows. Insert with ON CONFLICT DO NOTHING: a second delivery changes nothing.
--   truth_     of the drawn instrument, NULL if no draw was acceptable (status 4)
--   estimate_  of the calibration, NULL unless it came to an end (status 1 and 2)
--   error_     estimate - truth, computed when read
CREATE TABLE run_result (
  run_index   INTEGER PRIMARY KEY CHECK (run_index >= 0),
  -- 1 completed, 2 not converged, 3 not finite, 4 no draw
  status      INTEGER NOT NULL CHECK (status BETWEEN 1 AND 4),
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
  error_k2c_s2_m        REAL AS (estimate_k2c_s2_m - truth_k2c_s2_m)
) STRICT;

-- Who computed a run: the delivery that was kept.
CREATE TABLE delivery (
  run_index     INTEGER PRIMARY KEY REFERENCES run_result (run_index),
  worker        TEXT NOT NULL,
  attempt       INTEGER NOT NULL CHECK (attempt >= 0),
  compute_s     REAL NOT NULL,
  received_utc  TEXT NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ', 'now'))
) STRICT;

PRAGMA user_version = 2;
