-- What the model is, for programs that do not have it. Sets PRAGMA user_version = 12.

ALTER TABLE campaign ADD COLUMN model_description TEXT NOT NULL DEFAULT '';  -- JSON; empty: none

PRAGMA user_version = 12;
