// Cyclone DDS: no hub. A reliable writer that keeps all, since nothing may be lost, and a listener
// that takes on the library's thread. Bursts are gathered (WriteBatch), and wait() sends them.

#include <dds/dds.h>

#include <array>
#include <cstdlib>
#include <string>
#include <string_view>
#include <thread>
#include <utility>

#include "library/library_client.hpp"
#include "net/socket.hpp"

namespace gimnet::perf {
namespace {

constexpr std::chrono::seconds kPatience{10};
constexpr int kTakenMax = 64;
/// Over loopback alone, in datagrams as large as there can be: with its usual ones, large messages
/// cost more.
constexpr std::string_view kSettings =
    "<General><Interfaces><NetworkInterface name='lo'/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast><MaxMessageSize>65500B</MaxMessageSize>"
    "<FragmentSize>65000B</FragmentSize></General>"
    "<Discovery><ParticipantIndex>auto</ParticipantIndex>"
    "<Peers><Peer address='localhost'/></Peers></Discovery>";

/// The type `struct Message { sequence<octet> payload; };`, as `idlc` makes it.
constexpr std::array<std::uint32_t, 3> kOperations{
    std::uint32_t{DDS_OP_ADR} | std::uint32_t{DDS_OP_TYPE_SEQ} | std::uint32_t{DDS_OP_SUBTYPE_1BY},
    0, DDS_OP_RTS};
constexpr dds_topic_descriptor_t kType{sizeof(dds_sequence_t),
                                       alignof(dds_sequence_t),
                                       DDS_TOPIC_NO_OPTIMIZE,
                                       0,
                                       "Message",
                                       nullptr,
                                       2,
                                       kOperations.data(),
                                       "",
                                       {},
                                       {},
                                       0};

dds_entity_t check(dds_return_t result, const char* what) {
  if (result < 0) fail(std::string(what) + ": " + dds_strretcode(-result));
  return result;
}

class CycloneDdsClient final : public LibraryClient {
 public:
  ~CycloneDdsClient() override { dds_delete(participant_); }

  void open(const Setup& setup, OnMessage on_message) override {
    on_message_ = std::move(on_message);
    const char* batch = setup.is_bursty ? "<Internal><WriteBatch>true</WriteBatch></Internal>" : "";
    ::setenv("CYCLONEDDS_URI", (std::string(kSettings) + batch).c_str(), 1);
    participant_ = check(dds_create_participant(0, nullptr, nullptr), "join");
    dds_qos_t* how = dds_create_qos();
    dds_qset_reliability(how, DDS_RELIABILITY_RELIABLE, DDS_SECS(30));
    dds_qset_history(how, DDS_HISTORY_KEEP_ALL, DDS_LENGTH_UNLIMITED);
    dds_listener_t* listener = dds_create_listener(this);
    dds_lset_data_available(listener, [](dds_entity_t reader, void* self) {
      static_cast<CycloneDdsClient*>(self)->take(reader);
    });
    const auto reader =
        check(dds_create_reader(participant_, topic(setup.own), how, listener), "read");
    writer_ = check(dds_create_writer(participant_, topic(setup.partner), how, nullptr), "write");
    dds_delete_listener(listener);
    dds_delete_qos(how);
    if (setup.is_first) return;
    const auto deadline = Clock::now() + kPatience;
    while (dds_get_matched_subscriptions(writer_, nullptr, 0) < 1 ||
           dds_get_matched_publications(reader, nullptr, 0) < 1) {
      if (Clock::now() > deadline) fail("the partner was not found in time");
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }

  void send(std::span<const std::byte> payload) override {
    dds_sequence_t message{};
    message._maximum = message._length = static_cast<std::uint32_t>(payload.size());
    message._buffer = reinterpret_cast<std::uint8_t*>(const_cast<std::byte*>(payload.data()));
    check(dds_write(writer_, &message), "write");
  }

  bool wait(Clock::time_point deadline) override {
    dds_write_flush(writer_);
    return LibraryClient::wait(deadline);
  }

 private:
  dds_entity_t topic(const std::string& name) {
    return check(dds_create_topic(participant_, &kType, name.c_str(), nullptr, nullptr), "topic");
  }

  void take(dds_entity_t reader) {
    std::array<void*, kTakenMax> taken{};
    std::array<dds_sample_info_t, kTakenMax> about{};
    for (int count = kTakenMax; count == kTakenMax;) {
      count = check(dds_take(reader, taken.data(), about.data(), kTakenMax, kTakenMax), "take");
      for (int index = 0; index < count; ++index) {
        const auto& message = *static_cast<const dds_sequence_t*>(taken.at(index));
        if (!about.at(index).valid_data) continue;
        on_message_({reinterpret_cast<const std::byte*>(message._buffer), message._length});
      }
      if (count > 0) check(dds_return_loan(reader, taken.data(), count), "give back");
      taken.fill(nullptr);
    }
  }

  dds_entity_t participant_ = 0;
  dds_entity_t writer_ = 0;
  OnMessage on_message_;
};

}  // namespace

std::unique_ptr<LibraryClient> make_library_client() {
  return std::make_unique<CycloneDdsClient>();
}

}  // namespace gimnet::perf
