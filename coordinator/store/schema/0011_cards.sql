-- What a worker computed with beside processors. Sets PRAGMA user_version = 11.

ALTER TABLE worker ADD COLUMN cards TEXT NOT NULL DEFAULT '';  -- `2 NVIDIA ...`; empty: none

PRAGMA user_version = 11;
