// Checks manifests of Kubernetes against the API: `kubernetes_schema.mjs FILE...`.
//
// Values are checked by the OpenAPI validators of `kubernetes-models`. These let unknown fields pass, so
// each manifest is also written as a TypeScript literal of its interface, which the compiler checks.
// Needs the npm packages kubernetes-models, yaml and typescript beside it. Exit code 0 if all is right.
import { readFileSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { spawnSync } from 'node:child_process';
import YAML from 'yaml';

const require = createRequire(import.meta.url);

// Kubernetes reads YAML 1.1, in which 0440 is octal.
function manifestsOf(file) {
  const text = readFileSync(file, 'utf8');
  const documents = YAML.parseAllDocuments(text, { uniqueKeys: true, version: '1.1' });
  return documents.map((document) => {
    if (document.errors.length > 0) throw new Error(`${file}: ${document.errors[0].message}`);
    return document.toJS();
  });
}

function literalOf(manifest, index) {
  const { apiVersion, kind } = manifest;
  const module = `kubernetes-models/${apiVersion}/${kind}`;
  new (require(module)[kind])(manifest).validate();
  console.log(`${apiVersion} ${kind} ${manifest.metadata.name}: values are valid`);
  return `import type { I${kind} as T${index} } from '${module}';
export const manifest${index}: T${index} = ${JSON.stringify(manifest)};
`;
}

const manifests = process.argv.slice(2).flatMap(manifestsOf);
writeFileSync('manifests.ts', manifests.map(literalOf).join(''));
const options = ['--noEmit', '--strict', '--skipLibCheck', '--module', 'nodenext'];
const compiler = spawnSync('npx', ['tsc', ...options, 'manifests.ts'], { stdio: 'inherit' });
if (compiler.status !== 0) throw new Error('a manifest has a field that the API does not have');
console.log(`${manifests.length} manifests have known fields only`);
