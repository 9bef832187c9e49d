#pragma once

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <string_view>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "core/error.hpp"

namespace proofmass::test {

/// A folder of its own for a test's files, removed with everything in it.
class ScratchFolder {
 public:
  ScratchFolder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "proofmass-XXXXXX").string();
    PROOFMASS_EXPECT(mkdtemp(pattern.data()) != nullptr);
    path_ = pattern;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  std::filesystem::path write(const std::string& name, std::string_view text) const {
    std::ofstream(path_ / name, std::ios::binary) << text;
    return path_ / name;
  }

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// The campaign of a file with this text, which is given the name that it needs if it has none.
inline std::unique_ptr<Campaign> campaign_of_text(std::string_view text,
                                                  const ScratchFolder& folder,
                                                  coordinator::Overrides overrides = {}) {
  const auto is_name = [](std::string_view key) { return key.starts_with("campaign.name"); };
  const bool has_name = text.find("campaign.name") != text.npos ||
                        text.find("[campaign]\n    name") != text.npos ||
                        std::ranges::any_of(overrides.assignments, is_name);
  if (!has_name) overrides.assignments.push_back("campaign.name=test");
  return coordinator::read_campaign(folder.write("campaign.toml", text), overrides);
}

/// What read_campaign() says against a file `campaign.toml` with this text, the folder taken off;
/// empty if it says nothing.
inline std::string refusal_of(std::string_view text, const ScratchFolder& folder,
                              const coordinator::Overrides& overrides = {}) {
  try {
    (void)campaign_of_text(text, folder, overrides);
    return "";
  } catch (const DefinitionError& error) {
    std::string message = error.what();
    const std::string prefix = folder.path().string() + "/";
    if (message.starts_with(prefix)) message.erase(0, prefix.size());
    return message;
  }
}

inline std::string refusal_of(std::string_view text, const coordinator::Overrides& overrides = {}) {
  return refusal_of(text, ScratchFolder(), overrides);
}

}  // namespace proofmass::test
