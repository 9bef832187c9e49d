-- What came after the first release. Sets PRAGMA user_version = 9.

-- The version of the schema that the file was made with.
ALTER TABLE campaign ADD COLUMN first_version INTEGER NOT NULL DEFAULT 8;

-- In budget_coefficient, the level that `value` is for, and in proportion to; NULL where `value`
-- holds at any level of a run, and in files that were made before.
ALTER TABLE budget_coefficient ADD COLUMN assumed_level REAL CHECK (assumed_level > 0);

-- One row a run that has an estimate: the budget's total after its estimation, at its own level.
-- The total of the worst errors of all parameters is larger: no run has them all.
DROP VIEW run_budget;
CREATE VIEW run_budget AS
SELECT r.run_index, {budget_total_at_level} AS total_m_s2
FROM run_result AS r
WHERE r.status <= 2;

PRAGMA user_version = 9;
