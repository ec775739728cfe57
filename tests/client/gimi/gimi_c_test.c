/* gimnet/gimi.h in C11: compiles, talks, and answers misuse. Run by gimi_c_test.cpp. */

#include "tests/client/gimi/gimi_c_test.h"

#include <stdio.h>
#include <string.h>

#include "gimnet/gimi.h"

/* Programs keep these in arrays or inside structs of their own. */
#if UINTPTR_MAX == UINT64_MAX
_Static_assert(sizeof(gimi_message) == 128, "gimi_message");
_Static_assert(sizeof(gimi_batch) == 40, "gimi_batch");
_Static_assert(sizeof(gimi_list) == 32, "gimi_list");
_Static_assert(sizeof(gimi_watch_event) == 80, "gimi_watch_event");
_Static_assert(sizeof(gimi_connection_event) == 1056, "gimi_connection_event");
_Static_assert(sizeof(gimi_handle) == 8, "gimi_handle");
_Static_assert(sizeof(gimi_status) == 4, "gimi_status");
#endif

#define EXPECT(condition)                                     \
  do {                                                        \
    if (!(condition)) {                                       \
      fprintf(stderr, "line %d: %s\n", __LINE__, #condition); \
      return __LINE__;                                        \
    }                                                         \
  } while (0)

#define WAIT_MS 20000

static int talk_by_data(gimi_handle robot, gimi_handle viewer) {
  gimi_handle odometry, seen;
  gimi_message message;
  gimi_direction provider = GIMI_NOBODY;
  gimi_queue_counts counts = {.struct_size = sizeof counts};
  EXPECT(gimi_subscribe(viewer, "robot/odom", NULL, &seen) == GIMI_OK);
  EXPECT(gimi_advertise(robot, "odom", GIMI_OPTIONS(gimi_publish_options, .lane = GIMI_LANE_BULK),
                        &odometry) == GIMI_OK);
  EXPECT(gimi_wait_for_subscribers(odometry, 1, WAIT_MS) == GIMI_OK);
  EXPECT(gimi_wait_until_exists(seen, WAIT_MS) == GIMI_OK);
  EXPECT(gimi_provider(seen, &provider) == GIMI_OK && provider == GIMI_PROVIDES);
  EXPECT(gimi_publish(odometry, "x 1", 3, WAIT_MS, 0) == GIMI_OK);
  EXPECT(gimi_receive(seen, WAIT_MS, &message) == GIMI_OK);
  EXPECT(message.size == 3 && memcmp(message.data, "x 1", 3) == 0);
  EXPECT(strcmp(message.service, "robot/odom") == 0 && message.from == gimi_id(robot));
  EXPECT(message.lane == GIMI_LANE_BULK && message.sequence == 1);
  EXPECT((message.flags & GIMI_STAMPED) != 0 && message.identity == NULL);
  gimi_message_release(&message);
  EXPECT(message.data == NULL && message.service == NULL);
  EXPECT(gimi_counts(seen, &counts) == GIMI_OK && counts.received == 1);
  EXPECT(gimi_close(odometry) == GIMI_OK && gimi_close(odometry) == GIMI_CLOSED);
  EXPECT(gimi_close(seen) == GIMI_OK);
  return 0;
}

static int talk_by_commands(gimi_handle robot, gimi_handle viewer) {
  gimi_handle drive, commands;
  gimi_message message;
  char name[16];
  EXPECT(gimi_accept(robot, "drive", NULL, &commands) == GIMI_OK);
  EXPECT(gimi_sender_to_service(viewer, "robot/drive", NULL, WAIT_MS, &drive) == GIMI_OK);
  EXPECT(gimi_service_name(drive, name, sizeof name) == GIMI_OK);
  EXPECT(strcmp(name, "robot/drive") == 0 && gimi_sends_to(drive) == 0);
  EXPECT(gimi_send(drive, "left", 4, WAIT_MS, 0) == GIMI_OK);
  EXPECT(gimi_receive(commands, WAIT_MS, &message) == GIMI_OK && message.size == 4);
  EXPECT(strcmp(message.service, "robot/drive") == 0);
  EXPECT(gimi_service_name(commands, name, sizeof name) == GIMI_OK);
  EXPECT(strcmp(name, "robot/drive") == 0 && gimi_standing(commands) == GIMI_OK);
  gimi_message_release(&message);
  gimi_message_release(&message);
  EXPECT(gimi_close(drive) == GIMI_OK);
  EXPECT(gimi_close(commands) == GIMI_OK);
  EXPECT(gimi_receive(commands, WAIT_MS, &message) == GIMI_CLOSED);
  EXPECT(gimi_sender_to_service(robot, "robot/drive", NULL, WAIT_MS, &drive) == GIMI_NOT_FOUND);
  EXPECT(gimi_accept(robot, "drive", NULL, &commands) == GIMI_OK);
  EXPECT(gimi_leave(robot) == GIMI_OK);
  EXPECT(gimi_receive(commands, WAIT_MS, &message) == GIMI_CLOSED);
  EXPECT(gimi_close(commands) == GIMI_OK);
  return 0;
}

int gimi_c_talk(const char* url) {
  gimi_handle robot, viewer, odometry;
  gimi_list list;
  gimi_service_record service;
  gimi_peer found = 0;
  gimi_node_state state = {.struct_size = sizeof state};
  int wrong;
  EXPECT(gimi_join(GIMI_OPTIONS(gimi_node_options, .name = "robot", .hub = url), &robot) ==
         GIMI_OK);
  EXPECT(gimi_join(GIMI_OPTIONS(gimi_node_options, .hub = url), &viewer) == GIMI_OK);
  EXPECT(gimi_state(robot, &state) == GIMI_OK);
  EXPECT(strcmp(state.name, "robot") == 0 && state.connected && state.id == gimi_id(robot));
  EXPECT(gimi_find(viewer, "robot", WAIT_MS, &found) == GIMI_OK && found == state.id);
  if ((wrong = talk_by_data(robot, viewer)) != 0) return wrong;

  EXPECT(gimi_advertise(robot, "pose", NULL, &odometry) == GIMI_OK);
  EXPECT(gimi_services(viewer, "robot/*", WAIT_MS, &list) == GIMI_OK && list.count == 1);
  EXPECT(gimi_list_get(&list, 0, &service, sizeof service) == GIMI_OK);
  EXPECT(strcmp(service.name, "robot/pose") == 0 && service.direction == GIMI_PROVIDES);
  EXPECT(gimi_list_get(&list, 1, &service, sizeof service) == GIMI_BAD_ARGUMENT);
  gimi_list_release(&list);
  gimi_list_release(&list);
  EXPECT(list.count == 0);

  if ((wrong = talk_by_commands(robot, viewer)) != 0) return wrong;
  EXPECT(gimi_state(robot, &state) == GIMI_OK && gimi_close(odometry) == GIMI_OK);
  EXPECT(gimi_close(robot) == GIMI_OK && gimi_close(viewer) == GIMI_OK);
  return 0;
}

static const char kLarge[GIMI_PACKED_BYTES_MAX + 1] = "large";
static const gimi_bytes kThree[3] = {{"one", 3}, {kLarge, sizeof kLarge}, {NULL, 0}};

/* A window says how many messages may wait in the program. */
static int batch_of_window(gimi_handle node) {
  gimi_handle publisher, subscription;
  gimi_batch batch;
  EXPECT(gimi_advertise(node, "pose",
                        GIMI_OPTIONS(gimi_publish_options, .delivery = GIMI_SYNC, .window = 8),
                        &publisher) == GIMI_OK);
  EXPECT(gimi_subscribe(node, "robot/pose", NULL, &subscription) == GIMI_OK);
  EXPECT(gimi_wait_for_subscribers(publisher, 1, WAIT_MS) == GIMI_OK);
  EXPECT(gimi_publish_many(publisher, kThree, 3, WAIT_MS, NULL) == GIMI_OK);
  EXPECT(gimi_receive_packed(subscription, 64, WAIT_MS, &batch) == GIMI_OK && batch.count == 1);
  gimi_batch_release(&batch);
  EXPECT(gimi_close(subscription) == GIMI_OK && gimi_close(publisher) == GIMI_OK);
  return gimi_close(node);
}

/* A loan is sent once, as large as the program left it, and stays where it was not sent. */
static int loaned(gimi_handle publisher, gimi_handle subscription) {
  gimi_loaned loan, other;
  gimi_message message;
  EXPECT(gimi_loan(publisher, SIZE_MAX, &loan) == GIMI_TOO_LARGE && loan.data == NULL);
  EXPECT(gimi_publish_loan(publisher, &loan, WAIT_MS, 0) == GIMI_BAD_ARGUMENT);
  EXPECT(gimi_loan(publisher, 100000, &loan) == GIMI_OK && loan.size == 100000);
  EXPECT((uintptr_t)loan.data % 64 == 0);
  memset(loan.data, 'x', loan.size);
  EXPECT(gimi_publish_loan(0, &loan, WAIT_MS, 0) == GIMI_CLOSED && loan.data != NULL);
  loan.size = 200000;
  EXPECT(gimi_publish_loan(publisher, &loan, WAIT_MS, 0) == GIMI_BAD_ARGUMENT);
  loan.size = 90000;
  EXPECT(gimi_publish_loan(publisher, &loan, WAIT_MS, 0) == GIMI_OK && loan.data == NULL);
  EXPECT(gimi_receive(subscription, WAIT_MS, &message) == GIMI_OK && message.size == 90000);
  EXPECT((uintptr_t)message.data % 64 == 0 && ((const char*)message.data)[89999] == 'x');
  gimi_message_release(&message);
  EXPECT(gimi_loan(publisher, 0, &other) == GIMI_OK && other.size == 0);
  gimi_loan_release(&other);
  gimi_loan_release(&other);
  gimi_loan_release(NULL);
  return 0;
}

int gimi_c_batch(const char* url) {
  gimi_handle node, publisher, subscription;
  gimi_batch batch;
  uint32_t taken = 0;
  size_t sent = 0;
  EXPECT(gimi_join(GIMI_OPTIONS(gimi_node_options, .name = "robot", .hub = url), &node) == GIMI_OK);
  EXPECT(gimi_advertise(node, "odom", NULL, &publisher) == GIMI_OK);
  EXPECT(gimi_subscribe(node, "robot/odom", NULL, &subscription) == GIMI_OK);
  EXPECT(gimi_wait_for_subscribers(publisher, 1, WAIT_MS) == GIMI_OK);
  EXPECT(gimi_publish_many(publisher, kThree, 3, WAIT_MS, &sent) == GIMI_OK && sent == 3);
  while (taken < 3) {
    EXPECT(gimi_receive_packed(subscription, 64, WAIT_MS, &batch) == GIMI_OK);
    EXPECT(batch.message_size == sizeof(gimi_message));
    for (uint32_t i = 0; i < batch.count; ++i, ++taken) {
      const gimi_message* message = &batch.messages[i];
      const char* data = message->data;
      const char* bytes = batch.bytes;
      EXPECT(message->sequence == taken + 1 && message->size == kThree[taken].size);
      EXPECT(message->size == 0 || memcmp(data, kThree[taken].data, message->size) == 0);
      EXPECT(message->size == 0 || message->size > GIMI_PACKED_BYTES_MAX ||
             (data >= bytes && data + message->size <= bytes + batch.bytes_size));
    }
    gimi_batch_release(&batch);
    gimi_batch_release(&batch);
    EXPECT(batch.count == 0);
  }
  EXPECT(taken == 3);
  EXPECT(gimi_receive_packed(subscription, 64, 0, &batch) == GIMI_TIMEOUT && batch.count == 0);
  EXPECT(gimi_receive_packed(subscription, 0, 0, &batch) == GIMI_BAD_ARGUMENT);
  EXPECT(loaned(publisher, subscription) == 0);
  EXPECT(gimi_close(subscription) == GIMI_OK && gimi_close(publisher) == GIMI_OK);
  return batch_of_window(node);
}

/* Each function with a handle that it does not take. */
static int misuse_to_talk(gimi_handle handle, gimi_status expected) {
  gimi_handle made;
  gimi_direction provider;
  gimi_loaned loan;
  char text[8];
  gimi_node_state state = {.struct_size = sizeof state};
  gimi_lost_counts lost = {.struct_size = sizeof lost};
  gimi_send_counts sent = {.struct_size = sizeof sent};
  const gimi_bytes bytes = {"x", 1};
  const gimi_key key = {1, 2};
  const gimi_status answers[] = {
      gimi_leave(handle),
      gimi_state(handle, &state),
      gimi_lost(handle, &lost),
      gimi_take_name(handle, "x", 0),
      gimi_give_name_back(handle, 0),
      gimi_advertise(handle, "x", NULL, &made),
      gimi_publish(handle, "x", 1, 0, 0),
      gimi_publish_many(handle, &bytes, 1, 0, NULL),
      gimi_loan(handle, 1, &loan),
      gimi_wait_for_subscribers(handle, 1, 0),
      gimi_retained(handle),
      gimi_standing(handle),
      gimi_service_name(handle, text, sizeof text),
      gimi_subscribe(handle, "a/b", NULL, &made),
      gimi_provider(handle, &provider),
      gimi_wait_until_exists(handle, 0),
      gimi_accept(handle, "x", NULL, &made),
      gimi_sender_to_service(handle, "a/b", NULL, 0, &made),
      gimi_sender(handle, 1, NULL, &made),
      gimi_send(handle, "x", 1, 0, 0),
      gimi_settle(handle, 0),
      gimi_sent(handle, &sent),
      gimi_send_to(handle, 1, &bytes, NULL, 0),
      gimi_flush(handle),
      gimi_drain(handle, 0),
      gimi_queue(handle, key, NULL, &made),
  };
  for (size_t i = 0; i < sizeof answers / sizeof *answers; ++i) {
    if (answers[i] == expected) continue;
    fprintf(stderr, "call %d answered %s\n", (int)i, gimi_status_text(answers[i]));
    return __LINE__;
  }
  return 0;
}

static int misuse_to_ask(gimi_handle handle, gimi_status expected) {
  gimi_handle made;
  gimi_message message;
  gimi_batch batch;
  gimi_list list;
  gimi_watch_event event;
  gimi_peer peer;
  int64_t ns;
  char text[8];
  gimi_queue_counts counts = {.struct_size = sizeof counts};
  const gimi_link_options link = {.struct_size = sizeof link, .url = "unix:/a"};
  const gimi_reassignment ids = {1, 2};
  const gimi_status answers[] = {
      gimi_receive_newest(handle, &message),
      gimi_receive_packed(handle, 1, 0, &batch),
      gimi_resize(handle, 1),
      gimi_counts(handle, &counts),
      gimi_find(handle, "x", 0, &peer),
      gimi_name_of(handle, 1, 0, text, sizeof text),
      gimi_nodes(handle, NULL, 0, &list),
      gimi_services(handle, NULL, 0, &list),
      gimi_watch(handle, NULL, 0, 0, &made),
      gimi_watch_receive(handle, 0, &event),
      gimi_hub(handle, GIMI_HUB, 0, 0, &list),
      gimi_ping(handle, 1, 0, NULL, 0, &ns),
      gimi_trace(handle, 1, 0, 0, &ns, &list),
      gimi_kick(handle, 1, NULL, 0, text, sizeof text),
      gimi_reassign(handle, ids, 0),
      gimi_drain_hub(handle, 0),
      gimi_reload_hub(handle, 0, &list),
      gimi_add_link(handle, &link, 0),
      gimi_remove_link(handle, "a", 0),
      gimi_set_link_cost(handle, "a", 1, 0),
      gimi_set_hub_log_level(handle, "off", 0, text, sizeof text),
  };
  for (size_t i = 0; i < sizeof answers / sizeof *answers; ++i) {
    if (answers[i] == expected) continue;
    fprintf(stderr, "call %d answered %s\n", (int)i, gimi_status_text(answers[i]));
    return __LINE__;
  }
  return 0;
}

static int misuse_with(gimi_handle handle, gimi_status expected) {
  const int wrong = misuse_to_talk(handle, expected);
  if (wrong != 0) return wrong;
  EXPECT(gimi_id(handle) == 0 && gimi_subscribers(handle) == 0 && gimi_published(handle) == 0);
  EXPECT(gimi_sends_to(handle) == 0);
  return misuse_to_ask(handle, expected);
}

int gimi_c_misuse(const char* url) {
  gimi_handle node, other;
  gimi_message message;
  gimi_node_state unsized = {.struct_size = 0};
  char long_name[300];
  int wrong;
  if ((wrong = misuse_with(0, GIMI_CLOSED)) != 0) return wrong;
  if ((wrong = misuse_with(UINT64_MAX, GIMI_CLOSED)) != 0) return wrong;
  EXPECT(gimi_close(0) == GIMI_CLOSED && gimi_receive(0, 0, &message) == GIMI_CLOSED);

  EXPECT(gimi_join(NULL, NULL) == GIMI_BAD_ARGUMENT && *gimi_error_text() != '\0');
  EXPECT(gimi_join(GIMI_OPTIONS(gimi_node_options, .hub = url), &node) == GIMI_OK);
  EXPECT(gimi_state(node, NULL) == GIMI_BAD_ARGUMENT);
  EXPECT(gimi_state(node, &unsized) == GIMI_BAD_ARGUMENT);
  EXPECT(gimi_receive(node, 0, NULL) == GIMI_BAD_ARGUMENT);
  EXPECT(gimi_publish(node, NULL, 1, 0, 0) == GIMI_BAD_ARGUMENT);
  EXPECT(gimi_publish(node, "x", 1, 0, 0) == GIMI_BAD_ARGUMENT);
  EXPECT(gimi_settle(node, 0) == GIMI_BAD_ARGUMENT);
  EXPECT(gimi_subscribe(node, NULL, NULL, &other) == GIMI_BAD_ARGUMENT);
  EXPECT(gimi_subscribe(node, "no-slash", NULL, &other) == GIMI_BAD_NAME && other == 0);
  EXPECT(gimi_advertise(node, "odom", NULL, &other) == GIMI_DENIED);
  EXPECT(gimi_nodes(node, "a//b", 0, NULL) == GIMI_BAD_ARGUMENT);
  memset(long_name, 'n', sizeof long_name);
  long_name[sizeof long_name - 1] = '\0';
  EXPECT(gimi_take_name(node, long_name, 1000) == GIMI_BAD_NAME);
  EXPECT(gimi_join(GIMI_OPTIONS(gimi_node_options, .hub = url, .name = long_name), &other) ==
         GIMI_BAD_NAME);
  EXPECT(gimi_sender(node, 1, GIMI_OPTIONS(gimi_send_options, .lane = 9), &other) ==
         GIMI_BAD_ARGUMENT);
  EXPECT(gimi_watch(node, NULL, 8, 0, &other) == GIMI_BAD_ARGUMENT);
  EXPECT(gimi_hub(node, 77, 0, 0, NULL) == GIMI_BAD_ARGUMENT);
  EXPECT(gimi_list_get(NULL, 0, NULL, 0) == GIMI_BAD_ARGUMENT);
  gimi_list_release(NULL);
  gimi_batch_release(NULL);
  gimi_watch_event_release(NULL);

  /* Success, release and close leave the sentence alone. */
  EXPECT(gimi_settle(node, 0) == GIMI_BAD_ARGUMENT);
  EXPECT(gimi_flush(node) == GIMI_OK && strstr(gimi_error_text(), "another kind") != NULL);
  EXPECT(gimi_close(0) == GIMI_CLOSED && strstr(gimi_error_text(), "another kind") != NULL);
  EXPECT(gimi_close(node) == GIMI_OK && strstr(gimi_error_text(), "another kind") != NULL);
  return misuse_with(node, GIMI_CLOSED);
}

/* A program of a later header, and one of an earlier. */
int gimi_c_later_versions(const char* url) {
  struct {
    gimi_node_options now;
    uint64_t later;
  } options = {.now = {.struct_size = sizeof options, .hub = url}, .later = 0};
  struct {
    gimi_node_record now;
    uint64_t later;
  } record;
  gimi_handle node, other;
  gimi_list list;
  EXPECT(gimi_join(&options.now, &node) == GIMI_OK);
  options.later = 1;
  EXPECT(gimi_join(&options.now, &other) == GIMI_BAD_ARGUMENT && other == 0);
  options.later = 0;
  options.now.struct_size = offsetof(gimi_node_options, description);
  EXPECT(gimi_join(&options.now, &other) == GIMI_OK && gimi_close(other) == GIMI_OK);
  options.now.struct_size = 0;
  EXPECT(gimi_join(&options.now, &other) == GIMI_BAD_ARGUMENT);
  options.now.struct_size = (size_t)1 << 32;
  EXPECT(gimi_join(&options.now, &other) == GIMI_BAD_ARGUMENT);

  /* This version says that it does not have what later ones have. */
  EXPECT(gimi_join(GIMI_OPTIONS(gimi_node_options, .hub = url,
                                .credentials = (const gimi_credentials*)&options),
                   &other) == GIMI_BAD_ARGUMENT);
  EXPECT(gimi_accept(node, "drive", GIMI_OPTIONS(gimi_accept_options, .lease_ms = 100), &other) ==
         GIMI_BAD_ARGUMENT);

  EXPECT(gimi_nodes(node, NULL, WAIT_MS, &list) == GIMI_OK && list.count == 1);
  record.later = 1;
  EXPECT(gimi_list_get(&list, 0, &record, sizeof record) == GIMI_OK);
  EXPECT(record.later == 0 && record.now.id == gimi_id(node));
  EXPECT(gimi_list_get(&list, 0, &record, sizeof(gimi_peer)) == GIMI_OK);
  gimi_list_release(&list);
  return gimi_close(node);
}
