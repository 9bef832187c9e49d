#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace proofmass::test {

/// Gives this process and those that it will start mounts of their own, which go with them however
/// they end. False if that is not permitted.
[[nodiscard]] bool take_private_mounts();

/// Machines around a hub, each a network namespace of the kernel with a line of its own. Their
/// names are known to this process and its children only; all of it goes with them.
class StarNetwork {
 public:
  /// Makes the hub. @param directory  For what the programs that are used for this say.
  /// @throws std::runtime_error naming the command if something is not permitted or not installed;
  ///         all other functions as well.
  explicit StarNetwork(std::filesystem::path directory);

  void add(const std::string& machine);

  /// Words before a command that is to be run there; "hub" is a machine, too.
  [[nodiscard]] static std::vector<std::string> at(const std::string& machine);
  /// Of the hub, as every machine reaches it.
  static constexpr const char* hub_address = "10.77.0.1";

  /// Loses this fraction of the packets to and from the machine from now on; 1 cuts it off.
  void lose(const std::string& machine, double fraction);
  /// Nothing is lost from now on.
  void mend(const std::string& machine);
  /// Packets of the machine that were lost since it was added or mended.
  [[nodiscard]] std::size_t num_lost(const std::string& machine) const;

  /// Takes the machine's address away, and gives it another one.
  void change_address(const std::string& machine);

 private:
  struct Line {
    int number = 0;
    int address = 2;  ///< Its last byte.
  };

  void run(const std::string& words) const;
  void give_address(const std::string& machine) const;

  std::filesystem::path directory_;
  std::map<std::string, Line> lines_;
};

}  // namespace proofmass::test
