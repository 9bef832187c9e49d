#pragma once

#include <gtest/gtest.h>
#include <stdlib.h>

#include <string>

namespace proofmass::test {

/// Ends a test whose machine lacks something: skipped on a developer's, failed in CI, which must
/// have all. The caller returns.
inline void skip_for_want(const std::string& what) {
  if (getenv("CI") != nullptr) FAIL() << what;
  GTEST_SKIP() << what;
}

}  // namespace proofmass::test
