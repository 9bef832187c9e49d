namespace proofmass::worker {

// Not by its header, which takes the compiler two seconds: each model's programs compile this.
int run_proofmass_worker(int argc, char** argv);

}  // namespace proofmass::worker

int main(int argc, char** argv) { return proofmass::worker::run_proofmass_worker(argc, argv); }
