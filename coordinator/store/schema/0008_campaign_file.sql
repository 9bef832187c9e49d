-- A campaign file, with all that it holds from the beginning. Sets PRAGMA user_version = 8; files
-- of lower versions were made before the first release.
--
-- A word in braces stands for text that follows from the quantities of a result: see
-- detail/schema.hpp. One key has one name in all tables and views: run_index, parameter, term,
-- quantity, worker_key (and worker, its name).

CREATE TABLE campaign (
  campaign_id     INTEGER PRIMARY KEY CHECK (campaign_id = 1),  -- one file holds one campaign
  -- A random number names the campaign among those of a coordinator, also in a copied file.
  campaign_uid    INTEGER NOT NULL CHECK (campaign_uid > 0),
  name            TEXT NOT NULL,
  seed            TEXT NOT NULL CHECK (seed GLOB '[0-9]*'),     -- decimal: 64 bits without a sign
  num_runs        INTEGER NOT NULL CHECK (num_runs > 0),
  definition      TEXT NOT NULL,                                -- campaign file, canonical TOML
  model_version   TEXT NOT NULL,                                -- model that computes the runs
  build           TEXT NOT NULL,                                -- program that made the file
  created_utc     TEXT NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%SZ', 'now')),
  owner           TEXT NOT NULL DEFAULT '',   -- name of the key that submitted it; empty: none

  phase           TEXT NOT NULL DEFAULT 'active'
    CHECK (phase IN ('active', 'paused', 'finished', 'cancelled')),
  priority        INTEGER NOT NULL DEFAULT 0,                   -- a higher one is lent first
  audit_fraction  REAL NOT NULL DEFAULT 0.0
    CHECK (audit_fraction BETWEEN 0.0 AND 1.0),                 -- of the runs, computed twice

  -- When the campaign ends before all of its runs are finished.
  stop_rule       TEXT NOT NULL DEFAULT '',                     -- empty: none
  num_runs_max    INTEGER CHECK (num_runs_max > 0),             -- whatever the rule
  failures_max    INTEGER CHECK (failures_max >= 0),            -- then it stops

  -- 1 while results may stand only in the write-ahead log beside this file: a copy of the file that
  -- says so and has no log lacks results.
  is_log_needed   INTEGER NOT NULL DEFAULT 0 CHECK (is_log_needed IN (0, 1)),
  -- SHA-256 (hexadecimal) of {digested_tables}, as detail/table_digest.hpp lays
  -- them out; written with them.
  table_digest    TEXT NOT NULL DEFAULT '' CHECK (length(table_digest) IN (0, 64))
) STRICT;

-- The estimated parameters; unit is that of every number about them in this file.
CREATE TABLE parameter (
  position                  INTEGER PRIMARY KEY,
  parameter                 TEXT NOT NULL UNIQUE,
  label                     TEXT NOT NULL,
  unit                      TEXT NOT NULL,
  objective                 REAL CHECK (objective > 0),  -- largest acceptable |error|; NULL: none
  paper_worst               REAL,                        -- |error| as published; NULL: nothing is
  paper_mean                REAL,
  paper_standard_deviation  REAL
) STRICT;

-- Data that all runs share, as the files that the definition names hold it; empty without a file.
{data_tables}
-- Values of the drawn quantities whose law is a table, one for each run; unit as in the definition.
CREATE TABLE dispersion_value (
  quantity   TEXT NOT NULL,
  run_index  INTEGER NOT NULL CHECK (run_index >= 0),
  value      REAL NOT NULL,
  PRIMARY KEY (quantity, run_index)
) STRICT, WITHOUT ROWID;

-- What happened to the campaign; the newest 10,000 entries.
CREATE TABLE event (
  event_id  INTEGER PRIMARY KEY,
  time_utc  TEXT NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ', 'now')),
  kind      TEXT NOT NULL,
  text      TEXT NOT NULL CHECK (length(text) <= 2000)
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

-- One row a finished run, with what depends on campaign and run alone: two files of one campaign
-- hold the same rows. Insert with ON CONFLICT DO NOTHING: a second delivery changes nothing.
--   truth_     of what was drawn, NULL if no draw was acceptable (status 4)
--   estimate_  of the run, NULL unless the estimation came to an end (status 1 and 2)
--   error_     estimate - truth, computed when read
--   health_    of the loops, NULL if no draw was acceptable
--   loss_      why and in which session a run was lost, NULL unless it was (status 5)
CREATE TABLE run_result (
  run_index   INTEGER PRIMARY KEY CHECK (run_index >= 0),
  -- 1 completed, 2 not converged, 3 not finite, 4 no draw, 5 lost
  status      INTEGER NOT NULL CHECK (status BETWEEN 1 AND 5),
  num_draws   INTEGER NOT NULL CHECK (num_draws >= 0),
  num_rounds  INTEGER NOT NULL CHECK (num_rounds >= 0),

  {truth_columns},

  {estimate_columns},

  {error_columns},

  {standard_error_columns}
  {health_columns}
  -- 1 to {num_causes}: {cause_names}
  loss_cause    INTEGER CHECK (loss_cause BETWEEN 1 AND {num_causes})
                        CHECK ((loss_cause IS NULL) = (status <> 5)),
  -- 1 to {num_sessions}: {session_names}
  loss_session  INTEGER CHECK (loss_session BETWEEN 1 AND {num_sessions})
                        CHECK ((loss_session IS NULL) = (status <> 5))
) STRICT;

CREATE INDEX run_result_not_completed ON run_result (status) WHERE status <> 1;

-- Coordinator processes that served the campaign. No end: killed, or still there.
CREATE TABLE coordinator_start (
  start_id     INTEGER PRIMARY KEY,
  epoch        TEXT NOT NULL UNIQUE CHECK (length(epoch) = 16),  -- hexadecimal
  host         TEXT NOT NULL,
  process_id   INTEGER NOT NULL,
  version      TEXT NOT NULL,
  started_utc  TEXT NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ', 'now')),
  ended_utc    TEXT
) STRICT;

-- Worker processes that were registered while the campaign was served. No end: still there, as far
-- as is known.
CREATE TABLE worker (
  worker_key          INTEGER PRIMARY KEY,
  session             TEXT UNIQUE CHECK (length(session) = 16),  -- hexadecimal
  worker              TEXT NOT NULL,                            -- its name
  host                TEXT NOT NULL,
  process_id          INTEGER,
  num_slots           INTEGER,                                  -- runs that it computes at a time
  first_seen_utc      TEXT NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%SZ', 'now')),
  ended_utc           TEXT,
  end_reason          TEXT,                                     -- as in attempt
  num_results         INTEGER NOT NULL DEFAULT 0,               -- its rows in delivery
  compute_s           REAL NOT NULL DEFAULT 0.0,                -- their sum
  last_result_unix_s  INTEGER,                                  -- the newest of them
  CHECK ((ended_utc IS NULL) = (end_reason IS NULL))
) STRICT;

-- The delivery of each run that was kept; a number for the worker, and seconds, keep it small.
CREATE TABLE delivery (
  run_index        INTEGER PRIMARY KEY REFERENCES run_result (run_index),
  worker_key       INTEGER NOT NULL REFERENCES worker (worker_key),
  attempt          INTEGER NOT NULL CHECK (attempt >= 0),
  compute_s        REAL NOT NULL,
  received_unix_s  INTEGER NOT NULL
) STRICT;

-- Runs [first_run, first_run + num_runs) that came back without a result; the newest 1,000,000.
CREATE TABLE attempt (
  attempt_id   INTEGER PRIMARY KEY,
  first_run    INTEGER NOT NULL CHECK (first_run >= 0),
  num_runs     INTEGER NOT NULL CHECK (num_runs > 0),
  attempt      INTEGER NOT NULL CHECK (attempt >= 0),        -- how often they had been lent
  worker_key   INTEGER NOT NULL REFERENCES worker (worker_key),
  reason       TEXT NOT NULL,
  is_blamed    INTEGER NOT NULL CHECK (is_blamed IN (0, 1)),  -- counts against these runs
  lost_unix_s  INTEGER NOT NULL
) STRICT;

CREATE INDEX attempt_blamed ON attempt (first_run) WHERE is_blamed;

-- Runs that crashed too many workers. A result that comes later all the same deletes the row.
CREATE TABLE run_failure (
  run_index     INTEGER PRIMARY KEY CHECK (run_index >= 0),
  reason        TEXT NOT NULL,                             -- of the last loss that was blamed on it
  num_attempts  INTEGER NOT NULL CHECK (num_attempts >= 0),  -- losses that were blamed on it
  given_up_utc  TEXT NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ', 'now'))
) STRICT;

-- Second results, compared with the stored ones. One that differs was computed wrongly, or the
-- stored one was. A worker has one row a run: what differed once stays.
CREATE TABLE audit (
  run_index        INTEGER NOT NULL REFERENCES run_result (run_index),
  worker_key       INTEGER NOT NULL REFERENCES worker (worker_key),
  is_equal         INTEGER NOT NULL CHECK (is_equal IN (0, 1)),
  stored_digest    TEXT NOT NULL CHECK (length(stored_digest) = 16),   -- FNV-1a, hexadecimal
  second_digest    TEXT NOT NULL CHECK (length(second_digest) = 16),
  compared_unix_s  INTEGER NOT NULL,
  PRIMARY KEY (run_index, worker_key)
) STRICT, WITHOUT ROWID;

CREATE INDEX audit_contradiction ON audit (run_index) WHERE NOT is_equal;

-- Runs with an |error| above the objective of a parameter; kept with the results, as a million of
-- these cannot be searched in a moment.
CREATE TABLE overrun (
  run_index   INTEGER PRIMARY KEY REFERENCES run_result (run_index),
  parameters  INTEGER NOT NULL CHECK (parameters > 0)  -- bit n: the one at position n + 1
) STRICT;

-- The ten runs with the largest |error| of each parameter; of equal ones the first. Kept with the
-- results, as `overrun` is.
CREATE TABLE worst_run (
  parameter  TEXT NOT NULL REFERENCES parameter (parameter),
  run_index  INTEGER NOT NULL REFERENCES run_result (run_index),
  magnitude  REAL NOT NULL CHECK (magnitude >= 0),  -- |error|, unit as in parameter
  PRIMARY KEY (parameter, run_index)
) STRICT, WITHOUT ROWID;

-- Statistics and budgets are computed outside SQL: its sums are not compensated and it has no
-- standard deviation.

-- Over the runs that have an estimate; unit as in parameter. _lower and _upper bound a 95 %
-- interval: NULL if runs are too few for one.
CREATE TABLE statistic (
  parameter             TEXT PRIMARY KEY REFERENCES parameter (parameter),
  num_runs              INTEGER NOT NULL CHECK (num_runs > 0),

  -- |estimate - truth|
  worst                     REAL NOT NULL,
  worst_run_index           INTEGER NOT NULL,
  num_beyond_objective      INTEGER NOT NULL,
  beyond_objective_lower    REAL NOT NULL,     -- of the share of such runs, by Clopper and Pearson
  beyond_objective_upper    REAL NOT NULL,
  mean                      REAL NOT NULL,
  mean_lower                REAL,              -- by Student's law
  mean_upper                REAL,
  standard_deviation        REAL NOT NULL,
  standard_deviation_lower  REAL,              -- by the bootstrap
  standard_deviation_upper  REAL,
  percentile_50             REAL NOT NULL,
  percentile_50_lower       REAL,              -- by order statistics
  percentile_50_upper       REAL,
  percentile_90             REAL NOT NULL,
  percentile_90_lower       REAL,
  percentile_90_upper       REAL,
  percentile_95             REAL NOT NULL,
  percentile_95_lower       REAL,
  percentile_95_upper       REAL,
  percentile_99             REAL NOT NULL,
  percentile_99_lower       REAL,
  percentile_99_upper       REAL,

  -- estimate - truth, with its sign
  bias                            REAL NOT NULL,
  bias_lower                      REAL,        -- by Student's law
  bias_upper                      REAL,
  rms                             REAL NOT NULL,
  error_standard_deviation        REAL NOT NULL,
  error_standard_deviation_lower  REAL,        -- by the errors' kurtosis
  error_standard_deviation_upper  REAL,
  skewness                        REAL NOT NULL  -- a number
) STRICT;

-- What `statistic` was computed from, and how often all objectives hold together.
CREATE TABLE summary (
  summary_id             INTEGER PRIMARY KEY CHECK (summary_id = 1),
  num_finished           INTEGER NOT NULL,
  num_estimated          INTEGER NOT NULL,  -- completed; also not converged in older files
  num_not_converged      INTEGER NOT NULL,
  num_not_finite         INTEGER NOT NULL,
  num_no_draw            INTEGER NOT NULL,
  num_lost               INTEGER NOT NULL,
  num_given_up           INTEGER NOT NULL,  -- not among the finished ones
  num_within_objectives  INTEGER NOT NULL,  -- no |error| of the run is beyond its objective
  -- 95 % interval of their share among the runs that are finished or given up, by Clopper and
  -- Pearson; NULL if there are none.
  within_objectives_lower  REAL,
  within_objectives_upper  REAL,
  -- SHA-256 (hexadecimal) of the results, as report/digest.hpp lays them out; and that of the
  -- columns health_ and loss_, empty if no run has any.
  digest                 TEXT NOT NULL CHECK (length(digest) = 64),
  health_digest          TEXT NOT NULL CHECK (length(health_digest) IN (0, 64)),
  computed_utc           TEXT NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%SZ', 'now'))
) STRICT;

-- Contributions to the measurement that the estimates serve, m/s²; the last row is their total.
-- After estimation with the worst and with the mean errors: NULL while no run has an estimate.
CREATE TABLE budget_entry (
  position          INTEGER PRIMARY KEY,
  term              TEXT NOT NULL UNIQUE,
  label             TEXT NOT NULL,
  before            REAL NOT NULL,
  after_worst       REAL,
  after_mean        REAL,
  paper_before      REAL NOT NULL,
  paper_after_worst REAL NOT NULL,
  paper_after_mean  REAL NOT NULL
) STRICT;

-- What an |error| of a parameter leaves in a term, m/s² for each of its units; 0 where it leaves
-- nothing is not listed. Terms are linear in the errors.
CREATE TABLE budget_coefficient (
  term       TEXT NOT NULL,
  parameter  TEXT NOT NULL REFERENCES parameter (parameter),
  value      REAL NOT NULL,
  PRIMARY KEY (term, parameter)
) STRICT, WITHOUT ROWID;

-- The stop rule against the runs below num_runs, each time that so many were finished.
CREATE TABLE stop_check (
  statistic            TEXT NOT NULL,                          -- `std({example_quantity})`
  num_runs             INTEGER NOT NULL CHECK (num_runs > 0),
  estimate             REAL NOT NULL,                          -- unit as in parameter
  lower                REAL,                                   -- 95 %; NULL if runs are too few
  upper                REAL,
  relative_half_width  REAL,
  is_reached           INTEGER NOT NULL CHECK (is_reached IN (0, 1)),
  checked_utc          TEXT NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%SZ', 'now')),
  PRIMARY KEY (statistic, num_runs)
) STRICT, WITHOUT ROWID;

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

CREATE VIEW worker_throughput AS
SELECT worker, host, process_id, num_slots, num_results, compute_s,
       compute_s / nullif(num_results, 0) AS run_s,
       first_seen_utc,
       strftime('%Y-%m-%dT%H:%M:%SZ', last_result_unix_s, 'unixepoch') AS last_result_utc,
       3600.0 * num_results / nullif(last_result_unix_s - strftime('%s', first_seen_utc), 0)
         AS results_per_h,
       ended_utc, end_reason
FROM worker
ORDER BY worker_key;

CREATE VIEW attempt_history AS
SELECT a.first_run, a.first_run + a.num_runs - 1 AS last_run, a.attempt, w.worker, w.host,
       a.reason, a.is_blamed, strftime('%Y-%m-%dT%H:%M:%SZ', a.lost_unix_s, 'unixepoch') AS lost_utc
FROM attempt AS a JOIN worker AS w USING (worker_key)
ORDER BY a.attempt_id;

-- One row a finished run: how it ended and who computed it.
CREATE VIEW run AS
SELECT r.run_index, {status_name} AS status, r.num_draws, r.num_rounds, w.worker, w.host, d.attempt,
       d.compute_s, strftime('%Y-%m-%dT%H:%M:%SZ', d.received_unix_s, 'unixepoch') AS received_utc
FROM run_result AS r JOIN delivery AS d USING (run_index) JOIN worker AS w USING (worker_key);

-- One row a run that has a draw.
CREATE VIEW loop_health AS
SELECT r.run_index, {status_name} AS status,
       {health_values}{loss_cause_name} AS loss_cause,
       {loss_session_name} AS loss_session
FROM run_result AS r
WHERE r.status <> 4
ORDER BY r.run_index;

CREATE VIEW parameter_accuracy AS
SELECT p.parameter, p.unit, p.objective,
       s.num_runs, s.worst, s.worst_run_index, s.num_beyond_objective,
       1.0 * s.num_beyond_objective / s.num_runs AS beyond_objective,
       s.beyond_objective_lower, s.beyond_objective_upper,
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
FROM parameter AS p LEFT JOIN statistic AS s USING (parameter)
ORDER BY p.position;

-- How often all objectives hold together: of the runs that are finished or given up. A run without
-- an estimate is not within them.
CREATE VIEW joint_accuracy AS
SELECT num_finished + num_given_up AS num_runs, num_within_objectives,
       1.0 * num_within_objectives / nullif(num_finished + num_given_up, 0) AS within_objectives,
       within_objectives_lower, within_objectives_upper
FROM summary;

-- One row a run and parameter.
CREATE VIEW error_long AS
SELECT r.run_index, p.parameter, p.unit, {truth_of_parameter} AS truth,
       {estimate_of_parameter} AS estimate, {error_of_parameter} AS error
FROM run_result AS r JOIN parameter AS p
WHERE r.status <= 2;

CREATE VIEW worst_runs AS
SELECT w.parameter,
       row_number() OVER (PARTITION BY p.position ORDER BY w.magnitude DESC, w.run_index) AS place,
       w.run_index, p.unit, e.truth, e.estimate, e.error, w.magnitude / p.objective AS ratio
FROM worst_run AS w
  JOIN parameter AS p ON p.parameter = w.parameter
  JOIN error_long AS e ON e.run_index = w.run_index AND e.parameter = w.parameter
ORDER BY p.position, place;

CREATE VIEW overruns AS
SELECT o.run_index, p.parameter, p.unit, p.objective, {error_of_parameter} AS error,
       abs({error_of_parameter}) / p.objective AS ratio
FROM overrun AS o
  JOIN parameter AS p ON (o.parameters >> (p.position - 1)) & 1
  LEFT JOIN run_result AS r ON r.run_index = o.run_index;

CREATE VIEW budget AS
SELECT term, label,
       before AS before_m_s2, after_worst AS after_worst_m_s2, after_mean AS after_mean_m_s2,
       paper_before AS paper_before_m_s2, paper_after_worst AS paper_after_worst_m_s2,
       paper_after_mean AS paper_after_mean_m_s2
FROM budget_entry
ORDER BY position;

-- One row a run that has an estimate: the budget's total after its estimation. The total of the
-- worst errors of all parameters is larger: no run has them all.
CREATE VIEW run_budget AS
SELECT run_index, {budget_total} AS total_m_s2
FROM run_result
WHERE status <= 2;

PRAGMA application_id = 1349668211;  -- 'PrMs'
PRAGMA user_version = 8;
