#pragma once

#include <cstdio>
#include <string>

namespace proofmass::test {

/// What a display writes in a mode until it has gone.
template <typename Display, typename Mode, typename Use>
std::string output_of(Mode mode, Use use) {
  std::FILE* const file = std::tmpfile();
  {
    Display display(mode, file);
    use(display);
  }
  std::rewind(file);
  std::string text;
  for (int c = std::fgetc(file); c != EOF; c = std::fgetc(file)) text += static_cast<char>(c);
  std::fclose(file);
  return text;
}

}  // namespace proofmass::test
