-- Statistics and budgets, computed outside SQL: its sums are not compensated and it has no standard
-- deviation. Views show them beside the paper's. Sets PRAGMA user_version = 3.

-- |estimate - truth| over the runs that have an estimate; unit as in parameter.
CREATE TABLE statistic (
  parameter             TEXT PRIMARY KEY REFERENCES parameter (name),
  num_runs              INTEGER NOT NULL CHECK (num_runs > 0),
  worst                 REAL NOT NULL,
  worst_run_index       INTEGER NOT NULL,
  mean                  REAL NOT NULL,
  standard_deviation    REAL NOT NULL,
  num_beyond_objective  INTEGER NOT NULL
) STRICT;

-- Contributions to the test of the equivalence principle, m/s²; the last row is their total. After
-- calibration with the worst and with the mean errors: NULL while no run has an estimate.
CREATE TABLE budget_entry (
  position          INTEGER PRIMARY KEY,
  name              TEXT NOT NULL UNIQUE,
  label             TEXT NOT NULL,
  before            REAL NOT NULL,
  after_worst       REAL,
  after_mean        REAL,
  paper_before      REAL NOT NULL,
  paper_after_worst REAL NOT NULL,
  paper_after_mean  REAL NOT NULL
) STRICT;

CREATE VIEW parameter_accuracy AS
SELECT p.name AS parameter, p.unit, p.objective,
       s.worst, s.mean, s.standard_deviation, s.num_beyond_objective, s.num_runs, s.worst_run_index,
       p.paper_worst, p.paper_mean, p.paper_standard_deviation
FROM parameter AS p LEFT JOIN statistic AS s ON s.parameter = p.name
ORDER BY p.position;

CREATE VIEW budget AS
SELECT label AS term,
       before AS before_m_s2, after_worst AS after_worst_m_s2, after_mean AS after_mean_m_s2,
       paper_before AS paper_before_m_s2, paper_after_worst AS paper_after_worst_m_s2,
       paper_after_mean AS paper_after_mean_m_s2
FROM budget_entry
ORDER BY position;

PRAGMA user_version = 3;
