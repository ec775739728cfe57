#pragma once

#include <vector>

#include "gimnet/nif.h"
#include "proto/control/ns.hpp"

namespace gimnet::nif {

/// Lists of the C API, with the memory that their records point into. nif_free_...() frees them.
[[nodiscard]] nif_node_list* make_node_list(std::vector<proto::ns::NodeRecord> records);
[[nodiscard]] nif_service_list* make_service_list(std::vector<proto::ns::ServiceRecord> records);

/// A record as C sees it. Valid until: the record changes.
[[nodiscard]] nif_node_record view_of(const proto::ns::NodeRecord& record);
[[nodiscard]] nif_service_record view_of(const proto::ns::ServiceRecord& record);

}  // namespace gimnet::nif
