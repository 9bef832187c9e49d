#include <sqlite3ext.h>

#include "coordinator/query/functions.hpp"

// Where the program that loads the extension keeps SQLite's functions.
SQLITE_EXTENSION_INIT1

/// Called by SQLite, which derives the name from that of the file, `proofmass_sqlite.so`.
extern "C" __attribute__((visibility("default"))) int sqlite3_proofmasssqlite_init(
    sqlite3* connection, char**, const sqlite3_api_routines* api) {
  SQLITE_EXTENSION_INIT2(api)
  return proofmass::coordinator::register_functions(connection);
}
