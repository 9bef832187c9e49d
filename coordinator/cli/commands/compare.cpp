#include <filesystem>

#include "coordinator/archive/comparison.hpp"
#include "coordinator/archive/comparison_text.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/standard_output.hpp"
#include "coordinator/cli/stop_signals.hpp"
#include "coordinator/store/store.hpp"

namespace proofmass::coordinator {
namespace {

struct CompareOptions {
  std::filesystem::path first;
  std::filesystem::path second;
  OutputFormat format = OutputFormat::text;
};

int compare_databases(const CompareOptions& options) {
  return run_until_stopped([&](const IsStopped& is_stopped) {
    const Store first = Store::open_read_only(options.first);
    const Store second = Store::open_read_only(options.second);
    CampaignComparison comparison;
    first.read_one_state([&] {
      second.read_one_state([&] {
        comparison =
            compare_campaigns(read_compared(first, is_stopped), read_compared(second, is_stopped));
      });
    });
    const auto print = options.format == OutputFormat::json ? comparison_json : comparison_text;
    print_lines(print(comparison, options.first.string(), options.second.string()));
    return exit_done;
  });
}

}  // namespace

void add_compare(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<CompareOptions>(
      app, chosen, "compare", "Compare the results of two campaigns", compare_databases);
  command.footer(exit_codes_text({exit_interrupted}));
  add_database(command, options.first, "A");
  add_database(command, options.second, "B");
  add_json_flag(command, options.format);
}

}  // namespace proofmass::coordinator
