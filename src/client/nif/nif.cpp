#include "gimnet/nif.h"

#include <cstring>
#include <string>

#include "client/nif/api.hpp"
#include "client/nif/error.hpp"
#include "client/nif/sized_struct.hpp"

// The C API but for names and services.

using gimnet::nif::Deadline;
using gimnet::nif::deadline_after;
using gimnet::nif::fail;
using gimnet::nif::find_node;
using gimnet::nif::guarded;
using gimnet::nif::has_size;
using gimnet::nif::Node;
using gimnet::nif::NodeRef;
using gimnet::nif::with_node;
using gimnet::nif::with_waiting_node;
using gimnet::nif::write_struct;

extern "C" {

nif_status nif_connect(const nif_options* options, nif_node** node) {
  return guarded([&]() -> nif_status {
    if (node == nullptr) return fail(NIF_BAD_ARGUMENT, "cannot connect: node is NULL");
    *node = nullptr;
    auto checked = gimnet::nif::read_options(options);
    if (!checked) return fail(checked.error());
    auto connected = Node::connect(std::move(*checked));
    if (!connected) return fail(connected.error());
    *node = gimnet::nif::add_node(*connected);
    if (*node != nullptr) return NIF_OK;
    (*connected)->begin_close();
    (*connected)->close();
    static_assert(gimnet::nif::kHandlesMax == 4'096);  // as nif.h says, too
    return fail(NIF_LIMIT, "cannot connect: this process has 4,096 open handles");
  });
}

nif_status nif_close(nif_node* node) {
  return guarded([&] { return gimnet::nif::close_node(node); });
}

nif_status nif_get_info(nif_node* node, nif_info* info) {
  return with_node(node, [&](Node& found) -> nif_status {
    if (!has_size(info))
      return fail(NIF_BAD_ARGUMENT, "cannot tell the state: info is NULL or has no struct_size");
    write_struct(found.info(), *info);
    return NIF_OK;
  });
}

uint32_t nif_id(nif_node* node) {
  const NodeRef found = find_node(node);
  return found ? found->id() : 0;
}

size_t nif_last_error(nif_node* node, char* buffer, size_t size) {
  size_t length = 0;
  if (buffer != nullptr && size > 0) *buffer = '\0';
  const nif_status status = with_node(node, [&](Node& found) -> nif_status {
    const std::string sentence = found.record().last_error();
    length = sentence.size();
    if (buffer == nullptr || size == 0) return NIF_OK;
    const std::string_view kept = gimnet::nif::cut_text(sentence, size - 1);
    std::memcpy(buffer, kept.data(), kept.size());
    buffer[kept.size()] = '\0';
    return NIF_OK;
  });
  return status == NIF_OK ? length : 0;
}

nif_status nif_send(nif_node* node, const nif_outgoing* message, int32_t timeout_ms) {
  return with_node(node, [&](Node& found) -> nif_status {
    if (message == nullptr) return fail(NIF_BAD_ARGUMENT, "cannot send: message is NULL");
    return found.send(*message, timeout_ms);
  });
}

nif_status nif_send_to(nif_node* node, uint32_t to, const void* data, size_t size) {
  const nif_bytes part = {data, size};
  nif_outgoing message = NIF_OUTGOING_INIT;
  message.to = to;
  message.parts = &part;
  message.part_count = 1;
  return nif_send(node, &message, NIF_FOREVER);
}

nif_status nif_flush(nif_node* node) {
  return with_node(node, [](Node& found) { return found.outbound().flush(); });
}

nif_status nif_drain(nif_node* node, int32_t timeout_ms) {
  return with_waiting_node(
      node, [&](Node& found) { return found.outbound().drain(deadline_after(timeout_ms)); });
}

nif_status nif_receive(nif_node* node, nif_incoming* in, int32_t timeout_ms) {
  size_t count = 0;
  return nif_receive_many(node, in, 1, &count, timeout_ms);
}

nif_status nif_receive_many(nif_node* node, nif_incoming* in, size_t capacity, size_t* count,
                            int32_t timeout_ms) {
  return with_node(node, [&](Node& found) -> nif_status {
    if (in == nullptr || count == nullptr || capacity == 0) {
      return fail(NIF_BAD_ARGUMENT, "cannot receive: no place to receive into");
    }
    *count = 0;
    if (found.options().callback != nullptr) {
      return fail(NIF_BAD_ARGUMENT, "cannot receive: everything is given to the callback");
    }
    const nif_status status =
        found.received().pop({in, capacity}, *count, deadline_after(timeout_ms));
    if (found.options().credit_by_program) return status;
    for (std::size_t i = 0; i < *count; ++i) {
      if (in[i].epoch != 0) found.credits().take(in[i].to, in[i].epoch, 1, i + 1 != *count);
    }
    return status;
  });
}

int nif_event_fd(nif_node* node) {
  int descriptor = -1;
  static_cast<void>(with_node(node, [&](Node& found) -> nif_status {
    descriptor = found.received().event_descriptor();
    return NIF_OK;
  }));
  return descriptor;
}

nif_status nif_deliver(nif_node* node) {
  return with_node(node, [](Node& found) -> nif_status {
    found.thread().deliver_again();
    return NIF_OK;
  });
}

nif_status nif_get_counters(nif_node* node, nif_counters* counters) {
  return with_node(node, [&](Node& found) -> nif_status {
    if (!has_size(counters)) {
      return fail(NIF_BAD_ARGUMENT,
                  "cannot tell the counters: counters is NULL or has no struct_size");
    }
    write_struct(found.counters(), *counters);
    return NIF_OK;
  });
}

}  // extern "C"
