-- What a campaign is made of: all that its results depend on. Sets PRAGMA user_version = 1.

CREATE TABLE campaign (
  campaign_id    INTEGER PRIMARY KEY CHECK (campaign_id = 1),  -- one file holds one campaign
  name           TEXT NOT NULL,
  seed           TEXT NOT NULL CHECK (seed GLOB '[0-9]*'),     -- decimal: 64 bits without a sign
  num_runs       INTEGER NOT NULL CHECK (num_runs > 0),
  definition     TEXT NOT NULL,                                -- campaign file, canonical TOML
  model_version  TEXT NOT NULL,                                -- model that computes the runs
  created_utc    TEXT NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%SZ', 'now'))
) STRICT;

-- The calibrated parameters; unit is that of every number about them in this file.
CREATE TABLE parameter (
  position                  INTEGER PRIMARY KEY,
  name                      TEXT NOT NULL UNIQUE,
  label                     TEXT NOT NULL,
  unit                      TEXT NOT NULL,
  objective                 REAL NOT NULL CHECK (objective > 0),  -- largest acceptable |error|
  paper_worst               REAL NOT NULL,                        -- [Hardy2013], |error|
  paper_mean                REAL NOT NULL,
  paper_standard_deviation  REAL NOT NULL
) STRICT;

-- The environment file; empty if the environment is harmonic. Accelerations in the satellite frame.
CREATE TABLE environment_row (
  position          INTEGER PRIMARY KEY,
  time_s            REAL NOT NULL,  -- from perigee
  linear_x_m_s2     REAL NOT NULL,
  linear_y_m_s2     REAL NOT NULL,
  linear_z_m_s2     REAL NOT NULL,
  angular_x_rad_s2  REAL NOT NULL,
  angular_y_rad_s2  REAL NOT NULL,
  angular_z_rad_s2  REAL NOT NULL
) STRICT;

-- Values of the drawn quantities whose law is a table, one for each run; unit as in the definition.
CREATE TABLE dispersion_value (
  name       TEXT NOT NULL,
  run_index  INTEGER NOT NULL CHECK (run_index >= 0),
  value      REAL NOT NULL,
  PRIMARY KEY (name, run_index)
) STRICT, WITHOUT ROWID;

-- What happened to the campaign; the newest 10,000 entries.
CREATE TABLE event (
  event_id  INTEGER PRIMARY KEY,
  time_utc  TEXT NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ', 'now')),
  kind      TEXT NOT NULL,
  text      TEXT NOT NULL CHECK (length(text) <= 2000)
) STRICT;

PRAGMA application_id = 1349668211;  -- 'PrMs'
PRAGMA user_version = 1;
