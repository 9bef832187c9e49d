#!/usr/bin/env python3
"""Makes an environment table of Proofmass from accelerometer data of GRACE or GRACE-FO.

    acc1b_environment.py ACC1B_2005-05-01_A.asc >environment.csv

Reads the text form of ACC1B, ACT1B or ACC1A: a header that ends with `# End of YAML header` or
`END OF HEADER`, then lines of GPS time, satellite, three linear (m/s2) and three angular
accelerations (rad/s2), residuals and quality flag. Lines with a flag are left out; between lines
the program interpolates. Axes stay those of the file: X along the flight, Z to the Earth.

A campaign takes the table with

    [environment]
    kind = "file"
    file = "environment.csv"
"""

import argparse
import sys

HEADER_ENDS = ("# End of YAML header", "END OF HEADER")
HEADINGS = ("time_s,linear_x_m_s2,linear_y_m_s2,linear_z_m_s2,"
            "angular_x_rad_s2,angular_y_rad_s2,angular_z_rad_s2")
ROWS_MAX = 200_000  # Of an environment table.


def rows_of(lines):
    """(GPS time in s, the six accelerations) of each line without a flag."""
    lines = iter(lines)
    if not any(line.strip() in HEADER_ENDS for line in lines):
        sys.exit("acc1b_environment.py: error: no end of a header (is this the text of ACC1B?)")
    for line in lines:
        words = line.split()
        if not words or set(words[-1]) != {"0"}:
            continue
        yield float(words[0]), words[2:8]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("file", help="text of ACC1B, ACT1B or ACC1A")
    parser.add_argument("--start", type=float, help="GPS time that becomes 0; by default the first")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="take each Nth line")
    options = parser.parse_args()
    with open(options.file, encoding="utf-8-sig") as file:
        rows = list(rows_of(file))[:: options.every]
    if not 2 <= len(rows) <= ROWS_MAX:
        sys.exit(f"acc1b_environment.py: error: rows = {len(rows)} (must be 2 to {ROWS_MAX}; "
                 "see --every)")
    start = rows[0][0] if options.start is None else options.start
    print(HEADINGS)
    for time_s, values in rows:
        print(f"{time_s - start:.17g}", *values, sep=",")


if __name__ == "__main__":
    main()
