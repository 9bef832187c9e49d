-- Who owns the campaign, whether the file is whole without its log, and what its tables must be.
-- Sets PRAGMA user_version = 6.

-- Name of the key that submitted the campaign; empty without keys, or if it was not submitted.
ALTER TABLE campaign ADD COLUMN owner TEXT NOT NULL DEFAULT '';

-- 1 while results may stand only in the write-ahead log beside this file: a copy of the file that
-- says so and has no log lacks results.
ALTER TABLE campaign ADD COLUMN is_log_needed INTEGER NOT NULL DEFAULT 0
  CHECK (is_log_needed IN (0, 1));

-- SHA-256 (hexadecimal) of environment_row and dispersion_value, as detail/table_digest.hpp lays
-- them out; written with them. Empty in files from before version 6.
ALTER TABLE campaign ADD COLUMN table_digest TEXT NOT NULL DEFAULT ''
  CHECK (length(table_digest) IN (0, 64));

PRAGMA user_version = 6;
