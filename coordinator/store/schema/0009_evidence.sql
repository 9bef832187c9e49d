-- What later statistics need to know of a campaign. Sets PRAGMA user_version = 9.

-- Runs that were asked for before the first result was there: the verdict about a requirement may
-- take their number as fixed. NULL: a stop rule ends the campaign, or an older program began it.
ALTER TABLE campaign ADD COLUMN num_runs_fixed INTEGER CHECK (num_runs_fixed > 0);

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

PRAGMA user_version = 9;
