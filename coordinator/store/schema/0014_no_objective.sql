-- Where a parameter has no objective, how many runs are beyond it is not known. Sets PRAGMA
-- user_version = 14.

DROP VIEW parameter_accuracy;
CREATE VIEW parameter_accuracy AS
SELECT p.parameter, p.unit, p.objective,
       s.num_runs, s.worst, s.worst_run_index, o.num_beyond_objective,
       1.0 * o.num_beyond_objective / o.num_runs AS beyond_objective,
       o.beyond_objective_lower, o.beyond_objective_upper,
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
     LEFT JOIN statistic AS o ON o.parameter = p.parameter AND p.objective IS NOT NULL
ORDER BY p.position;

PRAGMA user_version = 14;
