# find_package(gimnet): the targets gimnet::gimi, gimnet::nif and gimnet::bitestream, which link
# libgimnet.so, and the same with _static behind the name.
include(${CMAKE_CURRENT_LIST_DIR}/gimnet-targets.cmake)
