-- What the model computes where the campaign began. Sets PRAGMA user_version = 13.

-- Of its reference runs, 16 hexadecimal digits; empty for models without a description
ALTER TABLE campaign ADD COLUMN reference_digest TEXT NOT NULL DEFAULT '';

PRAGMA user_version = 13;
