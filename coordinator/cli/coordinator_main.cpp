namespace proofmass::coordinator {

// Not by its header, which takes the compiler five seconds: each model's programs compile this.
int run_proofmass_coordinator(int argc, char** argv);

}  // namespace proofmass::coordinator

int main(int argc, char** argv) {
  return proofmass::coordinator::run_proofmass_coordinator(argc, argv);
}
