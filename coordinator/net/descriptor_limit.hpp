#pragma once

namespace proofmass::coordinator {

/// Lets the process have as many open descriptors as the system allows: each connection is one, and
/// what shells and init systems give by default is often 1024. ZeroMQ ends the process if there is
/// none left for a local connection.
void raise_descriptor_limit();

}  // namespace proofmass::coordinator
