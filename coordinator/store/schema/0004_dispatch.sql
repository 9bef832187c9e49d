-- Who computed what, what was lost, given up and computed twice, and how the campaign is served.
-- Sets PRAGMA user_version = 4.

-- A random number names the campaign among those of a coordinator, also in a copied file.
ALTER TABLE campaign ADD COLUMN campaign_uid INTEGER NOT NULL DEFAULT 1 CHECK (campaign_uid > 0);
ALTER TABLE campaign ADD COLUMN build TEXT NOT NULL DEFAULT '';  -- program that made the file
ALTER TABLE campaign ADD COLUMN phase TEXT NOT NULL DEFAULT 'active'
  CHECK (phase IN ('active', 'paused', 'finished', 'cancelled'));
ALTER TABLE campaign ADD COLUMN priority INTEGER NOT NULL DEFAULT 0;  -- a higher one is lent first
ALTER TABLE campaign ADD COLUMN audit_fraction REAL NOT NULL DEFAULT 0.0
  CHECK (audit_fraction BETWEEN 0.0 AND 1.0);                         -- of the runs, computed twice
UPDATE campaign SET campaign_uid = 1 + (random() & 9223372036854775806);

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
  session             TEXT UNIQUE CHECK (length(session) = 16),  -- hexadecimal; NULL before 4
  name                TEXT NOT NULL,
  host                TEXT NOT NULL,
  process_id          INTEGER,
  num_slots           INTEGER,                                  -- runs that it computes at a time
  first_seen_utc      TEXT NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%SZ', 'now')),
  ended_utc           TEXT,
  end_reason          TEXT,                                     -- as in attempt; `unknown` before 4
  num_results         INTEGER NOT NULL DEFAULT 0,               -- its rows in delivery
  compute_s           REAL NOT NULL DEFAULT 0.0,                -- their sum
  last_result_unix_s  INTEGER,                                  -- the newest of them
  CHECK ((ended_utc IS NULL) = (end_reason IS NULL))
) STRICT;

INSERT INTO worker (name, host, first_seen_utc, ended_utc, end_reason, num_results, compute_s,
                    last_result_unix_s)
SELECT worker, '', min(received_utc), max(received_utc), 'unknown', count(*), sum(compute_s),
       CAST(strftime('%s', max(received_utc)) AS INTEGER)
FROM delivery GROUP BY worker;

-- The delivery of each run that was kept; a number for the worker, and seconds, keep it small.
CREATE TABLE delivery_by_worker (
  run_index        INTEGER PRIMARY KEY REFERENCES run_result (run_index),
  worker           INTEGER NOT NULL REFERENCES worker (worker_key),
  attempt          INTEGER NOT NULL CHECK (attempt >= 0),
  compute_s        REAL NOT NULL,
  received_unix_s  INTEGER NOT NULL
) STRICT;

INSERT INTO delivery_by_worker
SELECT d.run_index, w.worker_key, d.attempt, d.compute_s,
       CAST(strftime('%s', d.received_utc) AS INTEGER)
FROM delivery AS d JOIN worker AS w ON w.name = d.worker;

DROP TABLE delivery;
ALTER TABLE delivery_by_worker RENAME TO delivery;

-- Runs [first_run, first_run + num_runs) that came back without a result; the newest 1,000,000.
CREATE TABLE attempt (
  attempt_id   INTEGER PRIMARY KEY,
  first_run    INTEGER NOT NULL CHECK (first_run >= 0),
  num_runs     INTEGER NOT NULL CHECK (num_runs > 0),
  attempt      INTEGER NOT NULL CHECK (attempt >= 0),        -- how often they had been lent
  worker       INTEGER NOT NULL REFERENCES worker (worker_key),
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
  worker           INTEGER NOT NULL REFERENCES worker (worker_key),
  is_equal         INTEGER NOT NULL CHECK (is_equal IN (0, 1)),
  stored_digest    TEXT NOT NULL CHECK (length(stored_digest) = 16),   -- FNV-1a, hexadecimal
  second_digest    TEXT NOT NULL CHECK (length(second_digest) = 16),
  compared_unix_s  INTEGER NOT NULL,
  PRIMARY KEY (run_index, worker)
) STRICT, WITHOUT ROWID;

CREATE INDEX audit_contradiction ON audit (run_index) WHERE NOT is_equal;
CREATE INDEX run_result_not_completed ON run_result (status) WHERE status <> 1;

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
       (SELECT count(*) FROM audit) AS num_compared,
       (SELECT count(*) FROM audit WHERE NOT is_equal) AS num_contradicting,
       (SELECT strftime('%Y-%m-%dT%H:%M:%SZ', max(last_result_unix_s), 'unixepoch') FROM worker)
         AS last_result_utc
FROM campaign AS c, counts AS n;

CREATE VIEW worker_throughput AS
SELECT name AS worker, host, process_id, num_slots, num_results, compute_s,
       compute_s / nullif(num_results, 0) AS run_s,
       first_seen_utc,
       strftime('%Y-%m-%dT%H:%M:%SZ', last_result_unix_s, 'unixepoch') AS last_result_utc,
       3600.0 * num_results / nullif(last_result_unix_s - strftime('%s', first_seen_utc), 0)
         AS results_per_h,
       ended_utc, end_reason
FROM worker
ORDER BY worker_key;

CREATE VIEW attempt_history AS
SELECT a.first_run, a.first_run + a.num_runs - 1 AS last_run, a.attempt, w.name AS worker, w.host,
       a.reason, a.is_blamed, strftime('%Y-%m-%dT%H:%M:%SZ', a.lost_unix_s, 'unixepoch') AS lost_utc
FROM attempt AS a JOIN worker AS w ON w.worker_key = a.worker
ORDER BY a.attempt_id;

PRAGMA user_version = 4;
