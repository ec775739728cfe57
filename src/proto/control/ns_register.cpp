#include "proto/control/ns_register.hpp"

#include "proto/control/names.hpp"

namespace gimnet::proto::ns {

void RegisterName::write(bitestream::Writer& writer) const {
  put_clean_text(writer, 3, name, kWrittenNameBytesMax);
}
RegisterName RegisterName::read(Fields& fields) {
  return {fields.required_text(3, "name", kNameBytesMax)};
}

void RegisterNameAnswer::write(bitestream::Writer& writer) const {
  put_clean_text(writer, 3, name, kNameBytesMax);
  writer.put_opaque(5, token);
}
RegisterNameAnswer RegisterNameAnswer::read(Fields& fields) {
  RegisterNameAnswer answer;
  answer.name = fields.required_text(3, "name", kNameBytesMax);
  answer.token = fields.opaque(5, "token", kTokenBytesMax);
  return answer;
}

void UnregisterNameAnswer::write(bitestream::Writer& writer) const { writer.put_opaque(5, token); }
UnregisterNameAnswer UnregisterNameAnswer::read(Fields& fields) {
  return {fields.opaque(5, "token", kTokenBytesMax)};
}

void LetGo::write(bitestream::Writer& writer) const {
  if (!name.empty()) put_clean_text(writer, 3, name, kWrittenNameBytesMax);
  writer.put_opaque(5, token);
  if (user) writer.put_u32(6, *user);
}
LetGo LetGo::read(Fields& fields) {
  LetGo message;
  message.name = fields.text(3, "name", kNameBytesMax);
  message.token = fields.opaque(5, "token", kTokenBytesMax);
  if (fields.has(6)) message.user = fields.number<std::uint32_t>(6, "user", 0);
  return message;
}

void NameLost::write(bitestream::Writer& writer) const {
  put_clean_text(writer, 3, name, kNameBytesMax);
  writer.put_u32(4, holder.value());
  put_clean_text(writer, 5, sentence, kSentenceBytesMax);
}
NameLost NameLost::read(Fields& fields) {
  NameLost lost;
  lost.name = fields.required_text(3, "name", kNameBytesMax);
  lost.holder = NodeId{fields.number<std::uint32_t>(4, "node id", 0)};
  lost.sentence = fields.text(5, "sentence", kSentenceBytesMax);
  return lost;
}

}  // namespace gimnet::proto::ns
