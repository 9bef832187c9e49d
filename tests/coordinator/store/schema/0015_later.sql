-- A later version of the schema, for tests: a new column, a table made anew, and a view of both.

ALTER TABLE campaign ADD COLUMN colour TEXT NOT NULL DEFAULT 'grey';

-- Fails on a note that says so.
CREATE TABLE note_of_15 (
  note_id   INTEGER PRIMARY KEY,
  time_utc  TEXT NOT NULL,
  text      TEXT NOT NULL CHECK (text <> 'fails')
) STRICT;
INSERT INTO note_of_15 SELECT * FROM note;
DROP TABLE note;
ALTER TABLE note_of_15 RENAME TO note;

CREATE VIEW notes AS SELECT colour, text FROM campaign, note;

PRAGMA user_version = 15;
