-- Standard errors of estimates, and how well these fit. Sets PRAGMA user_version = 10.

-- In run_result:
--   standard_error_  of estimates that have one, NULL of all others
--   fit_             how well these estimates fit the data of their run, NULL without them
--   correlations     of these estimates: of each pair of them, (1, 2), (1, 3) ..., a JSON array
-- The index has the runs that have them, so that they are read where they are alone.
{added_columns}
-- One row a run with an estimate and parameter.
DROP VIEW error_long;
CREATE VIEW error_long AS
SELECT r.run_index, p.parameter, p.unit, {truth_of_parameter} AS truth,
       {estimate_of_parameter} AS estimate, {error_of_parameter} AS error,
       {standard_error_of_parameter} AS standard_error
FROM run_result AS r JOIN parameter AS p
WHERE r.status <= 2;

-- One row a finished run, and who computed it.
DROP VIEW run;
CREATE VIEW run AS
SELECT r.run_index, {status_name} AS status, r.num_draws, r.num_rounds, w.worker, w.host, d.attempt,
       d.compute_s, strftime('%Y-%m-%dT%H:%M:%SZ', d.received_unix_s, 'unixepoch') AS received_utc
       {fit_values}
FROM run_result AS r JOIN delivery AS d USING (run_index) JOIN worker AS w USING (worker_key);

-- One row a parameter whose estimates have standard errors: whether these say how far completed
-- runs are off. Of honest ones squared_ratio is 1, and 95 % of errors are within 1.96 of them.
CREATE VIEW standard_errors AS
SELECT parameter, unit, count(*) AS num_runs, avg(standard_error) AS mean_standard_error,
       avg(error * error) / avg(standard_error * standard_error) AS squared_ratio,
       avg(abs(error) < 1.96 * standard_error) AS within_95
FROM (SELECT p.position, p.parameter, p.unit, {error_of_parameter} AS error,
             {standard_error_of_parameter} AS standard_error
      FROM run_result AS r JOIN parameter AS p
      WHERE r.status = 1)
WHERE standard_error IS NOT NULL
GROUP BY position
ORDER BY position;

PRAGMA user_version = 10;
