#include "coordinator/net/service_snapshot.hpp"
#include "core/error.hpp"
#include "proto/wire/client_codec.hpp"
#include "tests/proto/wire/requests.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr TimePoint begin{};

proto::FactoryReport report_of(const std::string& name, std::uint64_t interval_s = 10) {
  return test::factory_report(name, interval_s);
}

std::vector<std::string> names(const FactoryReports& reports, TimePoint now) {
  std::vector<std::string> found;
  for (const proto::FactoryStatus& factory : reports.current(now)) {
    found.push_back(factory.report().name() + " of " + factory.owner());
  }
  return found;
}

TEST(FactoryReports, KeepTheLastOfEachNameAndOwner) {
  FactoryReports reports;
  reports.take(report_of("b"), "anna", begin);
  reports.take(report_of("a"), "anna", begin);
  reports.take(report_of("b"), "ben", begin);
  proto::FactoryReport later = report_of("b");
  later.set_num_wanted(7);
  reports.take(later, "anna", begin + seconds(5));
  const TimePoint now = begin + seconds(6);
  EXPECT_THAT(names(reports, now), ElementsAre("a of anna", "b of anna", "b of ben"));
  EXPECT_EQ(reports.current(now)[1].report().num_wanted(), 7U);
  EXPECT_EQ(reports.current(now)[1].silent_s(), 1.0);
  EXPECT_EQ(reports.current(now)[2].silent_s(), 6.0);
}

TEST(FactoryReports, AreForgottenAfterThreeIntervalsOfTheirOwn) {
  FactoryReports reports;
  reports.take(report_of("short", 1), "", begin);
  reports.take(report_of("long", 100), "", begin);
  EXPECT_THAT(names(reports, begin + seconds(3)), ElementsAre("long of ", "short of "));
  EXPECT_THAT(names(reports, begin + milliseconds(3001)), ElementsAre("long of "));
}

TEST(FactoryReports, AreBoundedInNumber) {
  FactoryReports reports;
  for (std::size_t i = 0; i < wire::factories_max; ++i) {
    reports.take(report_of(std::to_string(i)), "", begin);
  }
  EXPECT_EQ(test::message_of<Error>([&] { reports.take(report_of("more"), "", begin); }),
            "factories = 65 (must be at most 64)");
  reports.take(report_of("0"), "", begin);  // One that is known.
  EXPECT_EQ(reports.current(begin).size(), wire::factories_max);
  // Silent ones make room.
  reports.take(report_of("more"), "", begin + seconds(31));
  EXPECT_THAT(names(reports, begin + seconds(31)), ElementsAre("more of "));
}

}  // namespace
}  // namespace proofmass::coordinator
